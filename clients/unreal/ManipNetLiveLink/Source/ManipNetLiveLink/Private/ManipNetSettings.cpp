#include "ManipNetSettings.h"

#include "Engine/SkeletalMesh.h"
#include "LiveLinkSourceSettings.h"
#include "ManipNetLiveLinkSourceSettings.h"

namespace ManipNetSettings
{
std::string ToText(const FString& Text)
{
    return std::string(TCHAR_TO_UTF8(*Text));
}

std::string Read(const UManipNetLiveLinkSourceSettings& Settings, manipnet::Connection& To)
{
    const std::string Problem = manipnet::ParseConnection(ToText(Settings.Address), To);
    To.Actor = ToText(Settings.Actor);
    To.DelayS = Settings.Delay;
    To.Delivery = Settings.Delivery == EManipNetDelivery::Raw ? manipnet::Mode::Raw : manipnet::Mode::Smooth;
    To.Place.YawDegrees = Settings.Yaw;
    To.Place.Origin = {Settings.Origin.X, Settings.Origin.Y, Settings.Origin.Z};
    To.Place.Scale = Settings.Scale;
    To.Avatar = ToText(Settings.Avatar.ToString());
    To.AvatarBones = ToText(Settings.AvatarBoneMap);
    To.ControlPort = static_cast<std::uint16_t>(Settings.ControlPort);
    return Problem;
}

void Show(const manipnet::Connection& From, UManipNetLiveLinkSourceSettings& Settings)
{
    Settings.Address = UTF8_TO_TCHAR(manipnet::FormatAddress(From).c_str());
    Settings.Actor = UTF8_TO_TCHAR(From.Actor.c_str());
    Settings.Delay = From.DelayS;
    Settings.Delivery = From.Delivery == manipnet::Mode::Raw ? EManipNetDelivery::Raw : EManipNetDelivery::Smooth;
    Settings.Yaw = From.Place.YawDegrees;
    Settings.Origin = FVector(From.Place.Origin.X, From.Place.Origin.Y, From.Place.Origin.Z);
    Settings.Scale = From.Place.Scale;
    Settings.Avatar = TSoftObjectPtr<USkeletalMesh>(FSoftObjectPath(FString(UTF8_TO_TCHAR(From.Avatar.c_str()))));
    Settings.AvatarBoneMap = UTF8_TO_TCHAR(From.AvatarBones.c_str());
    Settings.ControlPort = From.ControlPort;
}

void ShowInLiveLink(const manipnet::Connection& From, ULiveLinkSourceSettings& Settings)
{
    Settings.ConnectionString = UTF8_TO_TCHAR(manipnet::FormatConnection(From).c_str());
    if (From.Delivery == manipnet::Mode::Raw)
    {
        Settings.BufferSettings.EngineTimeOffset = static_cast<float>(From.DelayS);
    }
}
}
