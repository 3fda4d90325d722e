#pragma once

#include "CoreMinimal.h"
#include "LiveLinkSourceFactory.h"

#include "ManipNetLiveLinkSourceFactory.generated.h"

/// Offers ManipNet in Live Link's "Add Source" menu. A preset stores only the connection string, which is sufficient.
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
