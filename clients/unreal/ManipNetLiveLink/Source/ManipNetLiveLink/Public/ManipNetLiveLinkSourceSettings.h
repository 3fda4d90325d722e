#pragma once

#include "CoreMinimal.h"
#include "LiveLinkSourceSettings.h"

#include "ManipNetLiveLinkSourceSettings.generated.h"

/** How frames reach Live Link. */
UENUM()
enum class EManipNetDelivery : uint8
{
    /** One frame for each engine tick, interpolated for that instant. */
    Smooth,
    /** Every frame as it arrives, at its capture time; Live Link buffers and interpolates. */
    Raw,
};

/** What can be changed about a source after it was created. All of it is part of the connection string in a preset. */
UCLASS()
class MANIPNETLIVELINK_API UManipNetLiveLinkSourceSettings : public ULiveLinkSourceSettings
{
    GENERATED_BODY()

public:
    /** Address for hands in the server's line "ready". */
    UPROPERTY(EditAnywhere, Category = "ManipNet")
    FString Address;

    /** Actor whose hands are shown; empty for the first one received. */
    UPROPERTY(EditAnywhere, Category = "ManipNet")
    FString Actor;

    /** Seconds by which the hands are shown late. 0.05 is enough on one machine. */
    UPROPERTY(EditAnywhere, Category = "ManipNet", meta = (ClampMin = "0", ClampMax = "1"))
    double Delay = 0.1;

    UPROPERTY(EditAnywhere, Category = "ManipNet")
    EManipNetDelivery Delivery = EManipNetDelivery::Smooth;

    /** Degrees by which the tracked space is turned about the vertical. */
    UPROPERTY(EditAnywhere, Category = "ManipNet", meta = (ClampMin = "-360", ClampMax = "360"))
    double Yaw = 0.0;

    /** Where the origin of the tracked space lies in the level. */
    UPROPERTY(EditAnywhere, Category = "ManipNet")
    FVector Origin = FVector(0.0, 0.0, 0.0);

    UPROPERTY(EditAnywhere, Category = "ManipNet", meta = (ClampMin = "0.001", ClampMax = "1000"))
    double Scale = 1.0;
};
