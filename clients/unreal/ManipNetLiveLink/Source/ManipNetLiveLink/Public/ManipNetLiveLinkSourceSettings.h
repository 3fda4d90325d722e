#pragma once

#include "CoreMinimal.h"
#include "LiveLinkSourceSettings.h"
#include "UObject/SoftObjectPtr.h"

#include "ManipNetLiveLinkSourceSettings.generated.h"

class USkeletalMesh;

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

    /**
     * Choose the character's skeletal mesh here, and the server solves contact on its bones: fingers that touch an object on
     * the performer's hand touch it on the character's too. The subjects then have the mesh's name in theirs. Empty: the
     * fingers turn as the performer's do.
     */
    UPROPERTY(EditAnywhere, Category = "ManipNet", meta = (DisplayName = "Solve On This Avatar"))
    TSoftObjectPtr<USkeletalMesh> Avatar;

    /** Bones of the avatar whose names are not known, in JSON: {"LeftHandIndex1": "a bone of the skeleton", ...}. */
    UPROPERTY(EditAnywhere, AdvancedDisplay, Category = "ManipNet", meta = (MultiLine = "true"))
    FString AvatarBoneMap;

    /** Port for control in the server's line "ready", to which the hands of the avatar are sent. */
    UPROPERTY(EditAnywhere, AdvancedDisplay, Category = "ManipNet", meta = (ClampMin = "1", ClampMax = "65535"))
    int32 ControlPort = 5557;
};
