#pragma once

#include <string>
#include <vector>

#include "Core/CharacterHand.h"
#include "CoreMinimal.h"

struct FReferenceSkeleton;

/// Converts skeletons of the engine to those of the core, and names the properties of subjects.
namespace ManipNetSkeletons
{
inline constexpr const TCHAR* WeightProperty = TEXT("ManipNetWeight");

/// Only subjects whose hands were solved on an avatar have it.
inline constexpr const TCHAR* AvatarProperty = TEXT("ManipNetAvatar");

std::string ToText(const FName& Name);
manipnet::LocalBone ToLocal(const FTransform& Transform);
std::vector<manipnet::LocalBone> ToLocal(const TArray<FTransform>& Transforms);
manipnet::RestSkeleton ToRest(const FReferenceSkeleton& Skeleton);
}
