#pragma once

#include <string>

#include "CoreMinimal.h"
#include "Core/Connection.h"

class ULiveLinkSourceSettings;
class UManipNetLiveLinkSourceSettings;

/// Converts between the settings that a user edits and a connection, whose text a preset stores.
namespace ManipNetSettings
{
std::string ToText(const FString& Text);

/// Reads the connection that the settings describe. Returns an empty string, or what is wrong with their address.
std::string Read(const UManipNetLiveLinkSourceSettings& Settings, manipnet::Connection& To);

void Show(const manipnet::Connection& From, UManipNetLiveLinkSourceSettings& Settings);

/// Sets what Live Link itself must know: a preset makes the source again from the connection string, and raw frames are
/// shown the delay late, so that there is a later one to interpolate to.
void ShowInLiveLink(const manipnet::Connection& From, ULiveLinkSourceSettings& Settings);
}
