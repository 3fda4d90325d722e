#pragma once

#include "CoreMinimal.h"
#include "Kismet/BlueprintAsyncActionBase.h"

#include "ManipNetRequest.generated.h"

DECLARE_DYNAMIC_MULTICAST_DELEGATE_OneParam(FManipNetReply, const FString&, Text);

/**
 * Remote control of the server from Blueprints: each function sends one request and goes on at once. The pin Replied follows
 * with the server's answer in JSON, or the pin Refused with the reason. Call Start Recording from a Take Recorder event to
 * record on the server whenever the engine records. Address is that for control in the server's line "ready".
 */
UCLASS()
class MANIPNETLIVELINK_API UManipNetRequest : public UBlueprintAsyncActionBase
{
    GENERATED_BODY()

public:
    UPROPERTY(BlueprintAssignable)
    FManipNetReply Replied;

    UPROPERTY(BlueprintAssignable)
    FManipNetReply Refused;

    /** Begins a recording with the name of a take in the server's folder of takes. */
    UFUNCTION(BlueprintCallable, Category = "ManipNet", meta = (BlueprintInternalUseOnly = "true", DisplayName = "ManipNet Start Recording"))
    static UManipNetRequest* StartRecording(const FString& Take, const FString& Address = TEXT("tcp://127.0.0.1:5557"));

    UFUNCTION(BlueprintCallable, Category = "ManipNet", meta = (BlueprintInternalUseOnly = "true", DisplayName = "ManipNet Stop Recording"))
    static UManipNetRequest* StopRecording(const FString& Address = TEXT("tcp://127.0.0.1:5557"));

    UFUNCTION(BlueprintCallable, Category = "ManipNet", meta = (BlueprintInternalUseOnly = "true", DisplayName = "ManipNet Pause"))
    static UManipNetRequest* Pause(bool bOn = true, const FString& Address = TEXT("tcp://127.0.0.1:5557"));

    /** Gives a tracked body another object of the server's catalogue. */
    UFUNCTION(BlueprintCallable, Category = "ManipNet", meta = (BlueprintInternalUseOnly = "true", DisplayName = "ManipNet Select Object"))
    static UManipNetRequest* SelectObject(
        const FString& Body, const FString& Object, double Scale = 1.0, const FString& Address = TEXT("tcp://127.0.0.1:5557"));

    /** Sends any request of docs/protocol.md, a JSON object with the field "op". */
    UFUNCTION(BlueprintCallable, Category = "ManipNet", meta = (BlueprintInternalUseOnly = "true", DisplayName = "ManipNet Send Request"))
    static UManipNetRequest* SendRequest(const FString& Json, const FString& Address = TEXT("tcp://127.0.0.1:5557"));

    virtual void Activate() override;

private:
    void Finish(bool bReplied, const FString& Text);

    FString Request;
    FString Server;
};
