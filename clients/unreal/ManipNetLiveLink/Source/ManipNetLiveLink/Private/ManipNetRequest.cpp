#include "ManipNetRequest.h"

#include <atomic>
#include <cstdio>
#include <string>

#include "Async/Async.h"
#include "Core/Connection.h"
#include "Core/ControlClient.h"
#include "Core/Json.h"
#include "ManipNetSettings.h"

namespace
{
constexpr int TimeoutMs = 10000;

FString Quoted(const FString& Text)
{
    return FString(UTF8_TO_TCHAR(manipnet::QuotedJson(ManipNetSettings::ToText(Text)).c_str()));
}

/// Sends the request and waits for the answer; it runs on a thread of its own.
manipnet::Answer Ask(const FString& Address, const FString& Request)
{
    manipnet::Connection To;
    manipnet::Answer Answer;
    Answer.Problem = manipnet::ParseConnection(ManipNetSettings::ToText(Address), To);
    const std::atomic<bool> Never{false};
    return Answer.Problem.empty()
        ? manipnet::ControlClient(To.Host, To.Port, Never, TimeoutMs).Ask(ManipNetSettings::ToText(Request))
        : Answer;
}
}

UManipNetRequest* UManipNetRequest::StartRecording(const FString& Take, const FString& Address)
{
    return SendRequest(FString::Printf(TEXT("{\"op\": \"record\", \"name\": %s}"), *Quoted(Take)), Address);
}

UManipNetRequest* UManipNetRequest::StopRecording(const FString& Address)
{
    return SendRequest(TEXT("{\"op\": \"stop_recording\"}"), Address);
}

UManipNetRequest* UManipNetRequest::Pause(bool bOn, const FString& Address)
{
    return SendRequest(FString::Printf(TEXT("{\"op\": \"pause\", \"on\": %s}"), bOn ? TEXT("true") : TEXT("false")), Address);
}

UManipNetRequest* UManipNetRequest::SelectObject(const FString& Body, const FString& Object, double Scale, const FString& Address)
{
    return SendRequest(FString::Printf(TEXT("{\"op\": \"select_object\", \"body\": %s, \"object\": %s, \"scale\": %.9g}"),
        *Quoted(Body), *Quoted(Object), Scale), Address);
}

UManipNetRequest* UManipNetRequest::SendRequest(const FString& Json, const FString& Address)
{
    UManipNetRequest* Made = NewObject<UManipNetRequest>();
    Made->Request = Json;
    Made->Server = Address;
    return Made;
}

void UManipNetRequest::Activate()
{
    const TWeakObjectPtr<UManipNetRequest> Weak(this);
    Async(EAsyncExecution::Thread, [Weak, To = Server, What = Request]()
    {
        const manipnet::Answer Answer = Ask(To, What);
        const bool bReplied = Answer.Problem.empty();
        const FString Text(UTF8_TO_TCHAR((bReplied ? Answer.Reply : Answer.Problem).c_str()));
        AsyncTask(ENamedThreads::GameThread, [Weak, bReplied, Text]()
        {
            if (UManipNetRequest* Waiting = Weak.Get())
            {
                Waiting->Finish(bReplied, Text);
            }
        });
    });
}

void UManipNetRequest::Finish(bool bReplied, const FString& Text)
{
    (bReplied ? Replied : Refused).Broadcast(Text);
    SetReadyToDestroy();
}
