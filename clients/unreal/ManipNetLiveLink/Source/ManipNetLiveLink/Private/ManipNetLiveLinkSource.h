#pragma once

#include <memory>
#include <string>

#include "CoreMinimal.h"
#include "Core/Client.h"
#include "ILiveLinkSource.h"

/// Shows a server's hands as animation subjects and its tracked bodies as transform subjects. The client reads the
/// network on its own thread; Live Link gets one frame per engine tick, interpolated for that instant.
class FManipNetLiveLinkSource final : public ILiveLinkSource
{
public:
    explicit FManipNetLiveLinkSource(const FString& ConnectionString);

    virtual void ReceiveClient(ILiveLinkClient* InClient, FGuid InSourceGuid) override;
    virtual void Update() override;
    virtual bool IsSourceStillValid() const override;
    virtual bool RequestSourceShutdown() override;
    virtual FText GetSourceType() const override;
    virtual FText GetSourceMachineName() const override;
    virtual FText GetSourceStatus() const override;

private:
    void PushHand(const manipnet::HandFrame& Hand, const TCHAR* Side, float Weight);
    void PushBody(const manipnet::BodyFrame& Body);
    FName SubjectName(const FString& Part) const;

    manipnet::Connection Connection;
    std::string Error;
    std::unique_ptr<manipnet::Client> Client;
    manipnet::HandsFrame Frame;
    ILiveLinkClient* LiveLink = nullptr;
    FGuid SourceGuid;
    TSet<FName> Described;
};
