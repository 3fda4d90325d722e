// The types of the engine that the plugin uses, complete enough to run it without Unreal.
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

using TCHAR = char;
using int32 = std::int32_t;
#define TEXT(text) text
#define UTF8_TO_TCHAR(text) (text)
#define TCHAR_TO_UTF8(text) (text)
#define LOCTEXT(key, text) FText::FromString(text)
#define UCLASS(...)
#define GENERATED_BODY(...)
#define MANIPNETLIVELINK_API
#define IMPLEMENT_MODULE(type, name) static_assert(sizeof(type) > 0, #name);

template <typename T>
std::remove_reference_t<T>&& MoveTemp(T&& value) {
    return std::move(value);
}
template <typename T>
using TSharedPtr = std::shared_ptr<T>;
template <typename T>
using TSharedRef = std::shared_ptr<T>;
template <typename T, typename... Args>
std::shared_ptr<T> MakeShared(Args&&... args) {
    return std::make_shared<T>(std::forward<Args>(args)...);
}

struct FString {
    std::string Value;
    FString(const TCHAR* text = "") : Value(text) {}
    const TCHAR* operator*() const { return Value.c_str(); }
    template <typename... Args>
    static FString Printf(const TCHAR* format, Args... args) {
        char text[512];
        std::snprintf(text, sizeof text, format, args...);
        return FString(text);
    }
};

struct FName : FString {
    explicit FName(const TCHAR* text = "") : FString(text) {}
    bool operator<(const FName& other) const { return Value < other.Value; }
};

struct FText {
    FString Value;
    static FText FromString(const FString& text) { return FText{text}; }
    const FString& ToString() const { return Value; }
};

template <typename T>
struct TArray : std::vector<T> {
    void Add(T value) { this->push_back(std::move(value)); }
};

template <typename T>
struct TSet : std::set<T> {
    void Add(const T& value) { this->insert(value); }
    bool Contains(const T& value) const { return this->count(value) > 0; }
    void Empty() { this->clear(); }
};

struct FGuid {};
struct FVector {
    double X, Y, Z;
    FVector(double x, double y, double z) : X(x), Y(y), Z(z) {}
};
struct FQuat {
    double X, Y, Z, W;
    FQuat(double x, double y, double z, double w) : X(x), Y(y), Z(z), W(w) {}
};
struct FTransform {
    FQuat Rotation{0, 0, 0, 1};
    FVector Translation{0, 0, 0};
    FTransform() = default;
    FTransform(const FQuat& rotation, const FVector& translation) : Rotation(rotation), Translation(translation) {}
};
struct FPlatformTime {
    static double Seconds() { return 0.0; }
};
struct FDefaultModuleImpl {};

// Live Link
struct FLiveLinkBase {
    virtual ~FLiveLinkBase() = default;
};
using UScriptStruct = std::function<std::shared_ptr<FLiveLinkBase>()>;
template <typename T>
struct TScriptStruct : FLiveLinkBase {
    static UScriptStruct StaticStruct() {
        return [] { return std::make_shared<T>(); };
    }
};
struct FLiveLinkData {
    std::shared_ptr<FLiveLinkBase> Value;
    explicit FLiveLinkData(const UScriptStruct& type) : Value(type()) {}
    template <typename T>
    T* Cast() {
        return dynamic_cast<T*>(Value.get());
    }
};
struct FLiveLinkStaticDataStruct : FLiveLinkData {
    using FLiveLinkData::FLiveLinkData;
};
struct FLiveLinkFrameDataStruct : FLiveLinkData {
    using FLiveLinkData::FLiveLinkData;
};
struct FLiveLinkWorldTime {
    double Time;
    explicit FLiveLinkWorldTime(double time = 0.0) : Time(time) {}
};
struct FLiveLinkSkeletonStaticData : TScriptStruct<FLiveLinkSkeletonStaticData> {
    TArray<FName> BoneNames, PropertyNames;
    TArray<int32> BoneParents;
    void SetBoneNames(const TArray<FName>& names) { BoneNames = names; }
    void SetBoneParents(const TArray<int32>& parents) { BoneParents = parents; }
};
struct FLiveLinkAnimationFrameData : TScriptStruct<FLiveLinkAnimationFrameData> {
    TArray<FTransform> Transforms;
    TArray<float> PropertyValues;
    FLiveLinkWorldTime WorldTime;
};
struct FLiveLinkTransformStaticData : TScriptStruct<FLiveLinkTransformStaticData> {};
struct FLiveLinkTransformFrameData : TScriptStruct<FLiveLinkTransformFrameData> {
    FTransform Transform;
    FLiveLinkWorldTime WorldTime;
};
struct UClass {};
struct ULiveLinkAnimationRole {
    static UClass* StaticClass() { return nullptr; }
};
struct ULiveLinkTransformRole {
    static UClass* StaticClass() { return nullptr; }
};
struct FLiveLinkSubjectKey {
    FGuid Source;
    FName SubjectName;
    FLiveLinkSubjectKey(FGuid source, FName name) : Source(source), SubjectName(std::move(name)) {}
};
struct ILiveLinkClient {
    virtual ~ILiveLinkClient() = default;
    virtual void PushSubjectStaticData_AnyThread(const FLiveLinkSubjectKey&, UClass*, FLiveLinkStaticDataStruct&&) = 0;
    virtual void PushSubjectFrameData_AnyThread(const FLiveLinkSubjectKey&, FLiveLinkFrameDataStruct&&) = 0;
};
struct ILiveLinkSource {
    virtual ~ILiveLinkSource() = default;
    virtual void ReceiveClient(ILiveLinkClient*, FGuid) = 0;
    virtual void Update() {}
    virtual bool IsSourceStillValid() const = 0;
    virtual bool RequestSourceShutdown() = 0;
    virtual FText GetSourceType() const = 0;
    virtual FText GetSourceMachineName() const = 0;
    virtual FText GetSourceStatus() const = 0;
};

// Slate
struct FReply {
    static FReply Handled() { return {}; }
};
struct SWidget {
    virtual ~SWidget() = default;
};
struct SEditableTextBox : SWidget {
    FText Shown;
    FText GetText() const { return Shown; }
    void Set(const FText& text) { Shown = text; }
};
struct SButton : SWidget {
    std::function<FReply()> Click;
    void Set(const FText&) {}
};
struct SHorizontalBox : SWidget {
    std::vector<TSharedPtr<SWidget>> Children;
    struct FSlot {
        TSharedPtr<SWidget> Child;
        FSlot& FillWidth(float) { return *this; }
        FSlot& AutoWidth() { return *this; }
        FSlot& operator[](TSharedPtr<SWidget> child) {
            Child = std::move(child);
            return *this;
        }
    };
    static FSlot Slot() { return {}; }
};
template <typename W>
struct TDeclaration {
    std::shared_ptr<W> Widget = std::make_shared<W>();
    TDeclaration& Text(const FText& text) {
        Widget->Set(text);
        return *this;
    }
    template <typename F>
    TDeclaration& OnClicked_Lambda(F call) {
        Widget->Click = call;
        return *this;
    }
    TDeclaration& operator+(const SHorizontalBox::FSlot& slot) {
        Widget->Children.push_back(slot.Child);
        return *this;
    }
    template <typename T>
    operator std::shared_ptr<T>() const {
        return Widget;
    }
};
#define SNew(type) TDeclaration<type>()

struct FOnLiveLinkSourceCreated {
    std::function<void(TSharedPtr<ILiveLinkSource>, FString)> Call;
    void ExecuteIfBound(TSharedPtr<ILiveLinkSource> source, FString text) const {
        if (Call) Call(std::move(source), std::move(text));
    }
};
struct ULiveLinkSourceFactory {
    enum class EMenuType { SubPanel, MenuEntry };
    using FOnLiveLinkSourceCreated = ::FOnLiveLinkSourceCreated;
    virtual ~ULiveLinkSourceFactory() = default;
    virtual FText GetSourceDisplayName() const = 0;
    virtual FText GetSourceTooltip() const = 0;
    virtual EMenuType GetMenuType() const = 0;
    virtual TSharedPtr<SWidget> BuildCreationPanel(FOnLiveLinkSourceCreated) const = 0;
    virtual TSharedPtr<ILiveLinkSource> CreateSource(const FString&) const = 0;
};
