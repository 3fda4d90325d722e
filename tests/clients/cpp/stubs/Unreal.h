// The types of the engine that the plugin uses, complete enough to run it without Unreal.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

using TCHAR = char;
using int32 = std::int32_t;
using uint32 = std::uint32_t;
using uint8 = std::uint8_t;
#define TEXT(text) text
#define UTF8_TO_TCHAR(text) (text)
#define TCHAR_TO_UTF8(text) (text)
#define LOCTEXT(key, text) FText::FromString(text)
#define UCLASS(...)
#define UENUM(...)
#define UPROPERTY(...)
#define UFUNCTION(...)
#define INDEX_NONE (-1)
#define DEFINE_LOG_CATEGORY_STATIC(category, verbosity, limit)
#define UE_LOG(category, verbosity, format, ...) LogLine(FString::Printf(format __VA_OPT__(, ) __VA_ARGS__))
// What the engine's header tool generates for a class has a name with the file and the line of the macro.
#define MANIPNET_JOIN_INNER(a, b, c) a##b##c
#define MANIPNET_JOIN(a, b, c) MANIPNET_JOIN_INNER(a, b, c)
#define GENERATED_BODY(...) MANIPNET_JOIN(CURRENT_FILE_ID, __LINE__, _GENERATED_BODY)
#define MANIPNETLIVELINK_API
#define IMPLEMENT_MODULE(type, name) static_assert(sizeof(type) > 0, #name);

template <typename T>
std::remove_reference_t<T>&& MoveTemp(T&& value) {
    return std::move(value);
}
/// As std::shared_ptr, with the engine's method.
template <typename T>
struct TSharedPtr : std::shared_ptr<T> {
    using std::shared_ptr<T>::shared_ptr;
    TSharedPtr(std::shared_ptr<T> other) : std::shared_ptr<T>(std::move(other)) {}
    bool IsValid() const { return this->get() != nullptr; }
};
template <typename T>
using TSharedRef = TSharedPtr<T>;
template <typename T, typename... Args>
TSharedPtr<T> MakeShared(Args&&... args) {
    return std::make_shared<T>(std::forward<Args>(args)...);
}

struct FString {
    std::string Value;
    FString(const TCHAR* text = "") : Value(text) {}
    const TCHAR* operator*() const { return Value.c_str(); }
    bool operator==(const FString& other) const { return Value == other.Value; }
    template <typename... Args>
    static FString Printf(const TCHAR* format, Args... args) {
        if constexpr (sizeof...(args) == 0) {
            return FString(format);
        } else {
            const int length = std::snprintf(nullptr, 0, format, args...);
            std::vector<char> text(static_cast<std::size_t>(length) + 1);
            std::snprintf(text.data(), text.size(), format, args...);
            return FString(text.data());
        }
    }
};

/// Everything that was logged.
inline std::string& Logged() {
    static std::string text;
    return text;
}
inline void LogLine(const FString& line) { Logged() += line.Value + "\n"; }

struct FName {
    std::string Value;
    explicit FName(const TCHAR* text = "") : Value(text) {}
    FString ToString() const { return FString(Value.c_str()); }
    bool operator<(const FName& other) const { return Value < other.Value; }
    bool operator==(const FName& other) const { return Value == other.Value; }
};

struct FText {
    FString Value;
    static FText FromString(const FString& text) { return FText{text}; }
    const FString& ToString() const { return Value; }
};

template <typename T>
struct TArray : std::vector<T> {
    void Add(T value) { this->push_back(std::move(value)); }
    int32 Num() const { return static_cast<int32>(this->size()); }
    bool IsValidIndex(int32 index) const { return index >= 0 && index < Num(); }
    T& operator[](int32 index) { return this->at(static_cast<std::size_t>(index)); }
    const T& operator[](int32 index) const { return this->at(static_cast<std::size_t>(index)); }
    template <typename Key>
    int32 IndexOfByKey(const Key& key) const {
        for (int32 i = 0; i < Num(); ++i)
            if ((*this)[i] == key) return i;
        return INDEX_NONE;
    }
};

template <typename T>
struct TSet : std::set<T> {
    void Add(const T& value) { this->insert(value); }
    bool Contains(const T& value) const { return this->count(value) > 0; }
    void Empty() { this->clear(); }
};

template <typename K, typename V>
struct TPair {
    K Key;
    V Value;
};

template <typename K, typename V>
struct TMap {
    std::map<K, V> Items;
    void Add(const K& key, const V& value) { Items.insert_or_assign(key, value); }
    bool Contains(const K& key) const { return Items.count(key) > 0; }
    void Empty() { Items.clear(); }
    template <typename Predicate>
    TMap FilterByPredicate(Predicate keep) const {
        TMap kept;
        for (const auto& [key, value] : Items)
            if (keep(TPair<K, V>{key, value})) kept.Add(key, value);
        return kept;
    }
};

struct FGuid {
    bool operator==(const FGuid&) const { return true; }
};
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
    FVector Scale3D{1, 1, 1};
    FTransform() = default;
    FTransform(const FQuat& rotation, const FVector& translation) : Rotation(rotation), Translation(translation) {}
    FQuat GetRotation() const { return Rotation; }
    FVector GetTranslation() const { return Translation; }
    FVector GetScale3D() const { return Scale3D; }
    void SetRotation(const FQuat& rotation) { Rotation = rotation; }
};
struct FPlatformTime {
    static double Seconds() { return 0.0; }
};

// Time
struct FTimecode {
    int32 Hours, Minutes, Seconds, Frames;
    bool bDropFrameFormat;
    FTimecode(int32 hours, int32 minutes, int32 seconds, int32 frames, bool drop)
        : Hours(hours), Minutes(minutes), Seconds(seconds), Frames(frames), bDropFrameFormat(drop) {}
};
struct FFrameRate {
    int32 Numerator = 60000, Denominator = 1001;
    FFrameRate() = default;
    FFrameRate(uint32 numerator, uint32 denominator)
        : Numerator(static_cast<int32>(numerator)), Denominator(static_cast<int32>(denominator)) {}
};
struct FQualifiedFrameTime {
    FTimecode Timecode{0, 0, 0, 0, false};
    FFrameRate Rate;
    FQualifiedFrameTime() = default;
    FQualifiedFrameTime(const FTimecode& timecode, const FFrameRate& rate) : Timecode(timecode), Rate(rate) {}
};

// Objects
struct FObjectInitializer {};
struct FPropertyChangedEvent {};
struct UClass {
    std::string Name;
};
struct UObject {
    UObject() = default;
    explicit UObject(const FObjectInitializer&) {}
    virtual ~UObject() = default;
};
template <typename T>
struct TSubclassOf {
    UClass* Class = nullptr;
    TSubclassOf(UClass* value) : Class(value) {}
    UClass* Get() const { return Class; }
};
template <typename T>
T* Cast(UObject* object) {
    return dynamic_cast<T*>(object);
}
struct FDefaultModuleImpl {};

// Assets by their paths
struct FSoftObjectPath {
    FString Path;
    explicit FSoftObjectPath(const FString& path) : Path(path) {}
};
template <typename T>
struct TSoftObjectPtr {
    FString Path;
    TSoftObjectPtr() = default;
    explicit TSoftObjectPtr(const FSoftObjectPath& path) : Path(path.Path) {}
    FString ToString() const { return Path; }
};
inline std::map<std::string, UObject*>& Assets() {
    static std::map<std::string, UObject*> assets;
    return assets;
}
template <typename T>
T* LoadObject(UObject*, const TCHAR* name) {
    const auto found = Assets().find(name);
    return found == Assets().end() ? nullptr : dynamic_cast<T*>(found->second);
}
template <typename T>
T* NewObject() {
    return new T();
}

// Tasks: those for the game thread wait until RunGameThread.
enum class EAsyncExecution { TaskGraph, Thread };
namespace ENamedThreads {
enum Type { GameThread };
}
struct GameThreadTasks {
    std::mutex Lock;
    std::vector<std::function<void()>> Waiting;
};
inline GameThreadTasks& Tasks() {
    static GameThreadTasks tasks;
    return tasks;
}
template <typename F>
void Async(EAsyncExecution, F task) {
    std::thread(task).detach();
}
template <typename F>
void AsyncTask(ENamedThreads::Type, F task) {
    const std::lock_guard<std::mutex> guard(Tasks().Lock);
    Tasks().Waiting.push_back(task);
}
inline void RunGameThread() {
    std::vector<std::function<void()>> tasks;
    {
        const std::lock_guard<std::mutex> guard(Tasks().Lock);
        tasks.swap(Tasks().Waiting);
    }
    for (const auto& task : tasks) task();
}

// Blueprints
template <typename T>
struct TWeakObjectPtr {
    T* Object;
    explicit TWeakObjectPtr(T* object) : Object(object) {}
    T* Get() const { return Object; }
};
#define DECLARE_DYNAMIC_MULTICAST_DELEGATE_OneParam(name, type, parameter) \
    struct name {                                                        \
        std::vector<std::function<void(type)>> Bound;                    \
        void Broadcast(type parameter) const {                           \
            for (const auto& call : Bound) call(parameter);              \
        }                                                                \
    }
struct UBlueprintAsyncActionBase : UObject {
    bool Ready = false;
    virtual void Activate() {}
    virtual void SetReadyToDestroy() { Ready = true; }
};

// Live Link
struct FLiveLinkBase {
    virtual ~FLiveLinkBase() = default;
};
struct FLiveLinkMetaData {
    FQualifiedFrameTime SceneTime;
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
    FLiveLinkWorldTime(double time = 0.0) : Time(time) {}
    double GetSourceTime() const { return Time; }
};
struct FLiveLinkBaseStaticData {
    TArray<FName> PropertyNames;
};
struct FLiveLinkBaseFrameData {
    FLiveLinkWorldTime WorldTime;
    FLiveLinkMetaData MetaData;
    TArray<float> PropertyValues;
};
struct FLiveLinkSkeletonStaticData : FLiveLinkBaseStaticData, TScriptStruct<FLiveLinkSkeletonStaticData> {
    TArray<FName> BoneNames;
    TArray<int32> BoneParents;
    void SetBoneNames(const TArray<FName>& names) { BoneNames = names; }
    void SetBoneParents(const TArray<int32>& parents) { BoneParents = parents; }
};
struct FLiveLinkAnimationFrameData : FLiveLinkBaseFrameData, TScriptStruct<FLiveLinkAnimationFrameData> {
    TArray<FTransform> Transforms;
};
struct FLiveLinkTransformStaticData : FLiveLinkBaseStaticData, TScriptStruct<FLiveLinkTransformStaticData> {};
struct FLiveLinkTransformFrameData : FLiveLinkBaseFrameData, TScriptStruct<FLiveLinkTransformFrameData> {
    FTransform Transform;
};
struct ULiveLinkRole {};
struct ULiveLinkAnimationRole : ULiveLinkRole {
    static UClass* StaticClass() { return nullptr; }
};
struct ULiveLinkTransformRole : ULiveLinkRole {
    static UClass* StaticClass() { return nullptr; }
};
struct FLiveLinkSubjectName {
    FName Name;
    FLiveLinkSubjectName(FName name) : Name(std::move(name)) {}
};
struct FLiveLinkSubjectKey {
    FGuid Source;
    FLiveLinkSubjectName SubjectName;
    FLiveLinkSubjectKey(FGuid source, FName name) : Source(source), SubjectName(std::move(name)) {}
};
struct FLiveLinkSourceBufferManagementSettings {
    float EngineTimeOffset = 0.0f;
};
class ULiveLinkSourceSettings : public UObject {
public:
    FString ConnectionString;
    FLiveLinkSourceBufferManagementSettings BufferSettings;
    static UClass* StaticClass() {
        static UClass type{"LiveLinkSourceSettings"};
        return &type;
    }
};
struct ILiveLinkClient {
    virtual ~ILiveLinkClient() = default;
    virtual void PushSubjectStaticData_AnyThread(const FLiveLinkSubjectKey&, TSubclassOf<ULiveLinkRole>, FLiveLinkStaticDataStruct&&) = 0;
    virtual void PushSubjectFrameData_AnyThread(const FLiveLinkSubjectKey&, FLiveLinkFrameDataStruct&&) = 0;
    virtual TArray<FLiveLinkSubjectKey> GetSubjects(bool bIncludeDisabledSubject, bool bIncludeVirtualSubject) const = 0;
};
struct ILiveLinkSource {
    virtual ~ILiveLinkSource() = default;
    virtual void ReceiveClient(ILiveLinkClient*, FGuid) = 0;
    virtual void InitializeSettings(ULiveLinkSourceSettings*) {}
    virtual void Update() {}
    virtual bool IsSourceStillValid() const = 0;
    virtual bool RequestSourceShutdown() = 0;
    virtual FText GetSourceType() const = 0;
    virtual FText GetSourceMachineName() const = 0;
    virtual FText GetSourceStatus() const = 0;
    virtual TSubclassOf<ULiveLinkSourceSettings> GetSettingsClass() const { return ULiveLinkSourceSettings::StaticClass(); }
    virtual void OnSettingsChanged(ULiveLinkSourceSettings*, const FPropertyChangedEvent&) {}
};

// Animation
struct FMeshBoneInfo {
    FName Name;
    int32 ParentIndex;
};
struct FReferenceSkeleton {
    TArray<FMeshBoneInfo> Bones;
    TArray<FTransform> Pose;
    int32 GetNum() const { return Bones.Num(); }
    FName GetBoneName(const int32 index) const { return Bones[index].Name; }
    int32 GetParentIndex(const int32 index) const { return Bones[index].ParentIndex; }
    const TArray<FTransform>& GetRefBonePose() const { return Pose; }
};
class USkeletalMesh : public UObject {
public:
    FReferenceSkeleton RefSkeleton;
    const FReferenceSkeleton& GetRefSkeleton() const { return RefSkeleton; }
};
struct FCompactPoseBoneIndex {
    int32 BoneIndex;
    explicit FCompactPoseBoneIndex(int32 index) : BoneIndex(index) {}
    int32 GetInt() const { return BoneIndex; }
};
struct FMeshPoseBoneIndex {
    int32 BoneIndex;
    explicit FMeshPoseBoneIndex(int32 index) : BoneIndex(index) {}
    int32 GetInt() const { return BoneIndex; }
};
/// The bones of a level of detail: `Indices` are those of the reference skeleton.
struct FBoneContainer {
    const FReferenceSkeleton* RefSkeleton = nullptr;
    TArray<int32> Indices;
    const FReferenceSkeleton& GetReferenceSkeleton() const { return *RefSkeleton; }
    FCompactPoseBoneIndex MakeCompactPoseIndex(const FMeshPoseBoneIndex& index) const {
        return FCompactPoseBoneIndex(Indices.IndexOfByKey(index.GetInt()));
    }
};
struct FCompactPose {
    FBoneContainer Container;
    TArray<FTransform> Bones;
    const FBoneContainer& GetBoneContainer() const { return Container; }
    FTransform& operator[](const FCompactPoseBoneIndex& index) { return Bones[index.GetInt()]; }
    const FTransform& operator[](const FCompactPoseBoneIndex& index) const { return Bones[index.GetInt()]; }
};
struct ULiveLinkRetargetAsset : UObject {
    explicit ULiveLinkRetargetAsset(const FObjectInitializer& initializer) : UObject(initializer) {}
    virtual void BuildPoseFromAnimationData(float, const FLiveLinkSkeletonStaticData*, const FLiveLinkAnimationFrameData*, FCompactPose&) {}
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
    operator TSharedPtr<T>() const {
        return std::shared_ptr<T>(Widget);
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
