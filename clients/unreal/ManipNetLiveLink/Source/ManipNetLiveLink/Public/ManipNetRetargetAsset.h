#pragma once

#include "CoreMinimal.h"
#include "LiveLinkRetargetAsset.h"

#include "ManipNetRetargetAsset.generated.h"

struct FManipNetBinding;

/**
 * Puts the fingers of a ManipNet subject on any character: choose it as the "Retarget Asset" of a Live Link Pose node. It
 * changes rotations only. The rest pose is that of the character's reference skeleton.
 */
UCLASS(Blueprintable, meta = (DisplayName = "ManipNet Fingers"))
class MANIPNETLIVELINK_API UManipNetRetargetAsset : public ULiveLinkRetargetAsset
{
    GENERATED_BODY()

public:
    UManipNetRetargetAsset(const FObjectInitializer& ObjectInitializer);

    /** Also turns the arm and the hand, so that the hand arrives at the tracked wrist. */
    UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "ManipNet")
    bool bMoveWrist = false;

    /** Bones whose names are not known, in JSON: {"LeftHandIndex1": "a bone of the skeleton", ...}. */
    UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "ManipNet", meta = (MultiLine = "true"))
    FString BoneMap;

    virtual void BuildPoseFromAnimationData(float DeltaTime, const FLiveLinkSkeletonStaticData* InSkeletonData,
        const FLiveLinkAnimationFrameData* InFrameData, FCompactPose& OutPose) override;

private:
    TSharedPtr<FManipNetBinding> Binding;
};

/** As ManipNet Fingers, but the wrist and the arm follow too. */
UCLASS(Blueprintable, meta = (DisplayName = "ManipNet Fingers and Wrist"))
class MANIPNETLIVELINK_API UManipNetWristRetargetAsset : public UManipNetRetargetAsset
{
    GENERATED_BODY()

public:
    UManipNetWristRetargetAsset(const FObjectInitializer& ObjectInitializer);
};
