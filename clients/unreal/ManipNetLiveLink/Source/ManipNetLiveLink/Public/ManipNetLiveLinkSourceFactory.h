#pragma once

#include "CoreMinimal.h"
#include "LiveLinkSourceFactory.h"

#include "ManipNetLiveLinkSourceFactory.generated.h"

/// Offers ManipNet in Live Link's "Add Source" menu. The connection string is all a preset keeps, and all it needs.
UCLASS()
class MANIPNETLIVELINK_API UManipNetLiveLinkSourceFactory : public ULiveLinkSourceFactory
{
    GENERATED_BODY()

public:
    virtual FText GetSourceDisplayName() const override;
    virtual FText GetSourceTooltip() const override;
    virtual EMenuType GetMenuType() const override { return EMenuType::SubPanel; }
    virtual TSharedPtr<SWidget> BuildCreationPanel(FOnLiveLinkSourceCreated OnLiveLinkSourceCreated) const override;
    virtual TSharedPtr<ILiveLinkSource> CreateSource(const FString& ConnectionString) const override;
};
