#include "ManipNetLiveLinkSourceFactory.h"

#include "Core/Connection.h"
#include "ManipNetLiveLinkSource.h"
#include "Widgets/Input/SButton.h"
#include "Widgets/Input/SEditableTextBox.h"
#include "Widgets/SBoxPanel.h"

#define LOCTEXT_NAMESPACE "ManipNetLiveLink"

FText UManipNetLiveLinkSourceFactory::GetSourceDisplayName() const
{
    return LOCTEXT("DisplayName", "ManipNet");
}

FText UManipNetLiveLinkSourceFactory::GetSourceTooltip() const
{
    return LOCTEXT("Tooltip", "Synthesised fingers from a ManipNet Live server");
}

TSharedPtr<SWidget> UManipNetLiveLinkSourceFactory::BuildCreationPanel(FOnLiveLinkSourceCreated OnLiveLinkSourceCreated) const
{
    const TSharedRef<SEditableTextBox> Address =
        SNew(SEditableTextBox).Text(FText::FromString(UTF8_TO_TCHAR(manipnet::Connection::kDefault)));
    const auto Create = [Address, OnLiveLinkSourceCreated]()
    {
        const FString Text = Address->GetText().ToString();
        const TSharedPtr<ILiveLinkSource> Source = MakeShared<FManipNetLiveLinkSource>(Text);
        OnLiveLinkSourceCreated.ExecuteIfBound(Source, Text);
        return FReply::Handled();
    };
    return SNew(SHorizontalBox)
        + SHorizontalBox::Slot().FillWidth(1.0f)[Address]
        + SHorizontalBox::Slot().AutoWidth()[SNew(SButton).Text(LOCTEXT("Create", "Create")).OnClicked_Lambda(Create)];
}

TSharedPtr<ILiveLinkSource> UManipNetLiveLinkSourceFactory::CreateSource(const FString& ConnectionString) const
{
    return MakeShared<FManipNetLiveLinkSource>(ConnectionString);
}

#undef LOCTEXT_NAMESPACE
