#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "CoreMinimal.h"
#include "Core/Client.h"
#include "Core/Skeleton.h"
#include "ILiveLinkSource.h"
#include "LiveLinkTypes.h"

/// Shows a server's hands as animation subjects and its tracked bodies as transform subjects. The client reads the
/// network on its own thread. In smooth mode Live Link gets one frame per engine tick, interpolated for that instant; in
/// raw mode it gets every frame from the client's thread, with its capture time.
class FManipNetLiveLinkSource final : public ILiveLinkSource
{
public:
    explicit FManipNetLiveLinkSource(const FString& ConnectionString);

    virtual void ReceiveClient(ILiveLinkClient* InClient, FGuid InSourceGuid) override;
    virtual void InitializeSettings(ULiveLinkSourceSettings* Settings) override;
    virtual void OnSettingsChanged(ULiveLinkSourceSettings* Settings, const FPropertyChangedEvent& PropertyChangedEvent) override;
    virtual TSubclassOf<ULiveLinkSourceSettings> GetSettingsClass() const override;
    virtual void Update() override;
    virtual bool IsSourceStillValid() const override;
    virtual bool RequestSourceShutdown() override;
    virtual FText GetSourceType() const override;
    virtual FText GetSourceMachineName() const override;
    virtual FText GetSourceStatus() const override;

private:
    void Start();
    std::unique_ptr<manipnet::Client> StartAvatar(const manipnet::Connection& To);
    void Retire();
    void ForgetRemovedSubjects();
    void PushRaw(const manipnet::HandsFrame& Frame);
    void PushFrame(const manipnet::HandsFrame& Frame, float Weight, double Time);
    void PushHand(const manipnet::HandsFrame& Frame, manipnet::Side Side, float Weight, double Time);
    void PushBody(const manipnet::HandsFrame& Frame, const manipnet::BodyFrame& Body, double Time);
    bool MustDescribe(const FName& Name);
    manipnet::Connection CurrentConnection() const;

    mutable std::mutex Lock;  ///< Guards the two that follow, which the client's thread uses in raw mode.
    manipnet::Connection Connection;
    TMap<FName, double> Described;  ///< When each subject was described.

    std::string Error;
    std::unique_ptr<manipnet::Client> Client;
    std::vector<std::unique_ptr<manipnet::Client>> Retired;  ///< Clients whose threads still end.
    manipnet::HandsFrame Shown;
    ILiveLinkClient* LiveLink = nullptr;
    FGuid SourceGuid;
    double Looked = 0.0;
};
