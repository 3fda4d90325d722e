// Runs the plugin's source, settings and factory on stubs of the engine with a live server: `glue ADDRESS`.
#include <atomic>
#include <chrono>
#include <iostream>
#include <map>
#include <mutex>
#include <thread>

#include "ManipNetLiveLinkSource.h"
#include "ManipNetLiveLinkSourceFactory.h"
#include "ManipNetLiveLinkSourceSettings.h"

namespace {

struct Recorder : ILiveLinkClient {
    mutable std::mutex Lock;
    std::map<std::string, FLiveLinkStaticDataStruct> Static;
    std::map<std::string, FLiveLinkFrameDataStruct> Newest;
    int Described = 0;
    std::atomic<int> Frames{0};
    std::atomic<bool> OtherThread{false};
    std::thread::id Own = std::this_thread::get_id();

    void PushSubjectStaticData_AnyThread(
        const FLiveLinkSubjectKey& key, TSubclassOf<ULiveLinkRole>, FLiveLinkStaticDataStruct&& data) override {
        const std::lock_guard<std::mutex> guard(Lock);
        ++Described;
        Static.insert_or_assign(key.SubjectName.Name.Value, std::move(data));
    }
    void PushSubjectFrameData_AnyThread(const FLiveLinkSubjectKey& key, FLiveLinkFrameDataStruct&& data) override {
        const std::lock_guard<std::mutex> guard(Lock);
        ++Frames;
        if (std::this_thread::get_id() != Own) OtherThread = true;
        if (Static.count(key.SubjectName.Name.Value) > 0) Newest.insert_or_assign(key.SubjectName.Name.Value, std::move(data));
    }
    TArray<FLiveLinkSubjectKey> GetSubjects(bool, bool) const override {
        const std::lock_guard<std::mutex> guard(Lock);
        TArray<FLiveLinkSubjectKey> keys;
        for (const auto& [name, data] : Static) keys.Add(FLiveLinkSubjectKey(FGuid(), FName(name.c_str())));
        return keys;
    }
    void Remove(const std::string& name) {
        const std::lock_guard<std::mutex> guard(Lock);
        Static.erase(name);
        Newest.erase(name);
    }
    bool Has(const std::string& name) const {
        const std::lock_guard<std::mutex> guard(Lock);
        return Newest.count(name) > 0;
    }
    template <typename T>
    T Get(const std::string& name) {
        const std::lock_guard<std::mutex> guard(Lock);
        return *Newest.at(name).Cast<T>();
    }
};

/// Ticks the source until a condition holds, for at most ten seconds.
template <typename Condition>
void TickUntil(ILiveLinkSource& source, Condition reached) {
    for (int i = 0; i < 1000 && !reached(); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        source.Update();
    }
}

void Print(const std::string& what, const FTransform& t) {
    std::cout << what << " " << t.Translation.X << " " << t.Translation.Y << " " << t.Translation.Z << " " << t.Rotation.X
              << " " << t.Rotation.Y << " " << t.Rotation.Z << " " << t.Rotation.W << "\n";
}

void PrintTimecode(const FQualifiedFrameTime& time) {
    const FTimecode& t = time.Timecode;
    std::cout << "timecode " << t.Hours << " " << t.Minutes << " " << t.Seconds << " " << t.Frames << " " << t.bDropFrameFormat
              << " " << time.Rate.Numerator << "/" << time.Rate.Denominator << "\n";
}

/// Changes the settings while the source runs: a level where it lies, raw delivery, another address and back.
void ChangeSettings(ILiveLinkSource& source, Recorder& recorder) {
    UManipNetLiveLinkSourceSettings settings;
    source.InitializeSettings(&settings);
    std::cout << "settings " << source.GetSettingsClass().Get()->Name << " " << settings.Address.Value << " " << settings.Delay << "\n";
    settings.Origin = FVector(0, 0, 1000);
    settings.Yaw = 90;
    source.OnSettingsChanged(&settings, FPropertyChangedEvent());
    TickUntil(source, [&] { return recorder.Get<FLiveLinkTransformFrameData>("ManipNet_actor_cube").Transform.Translation.Z > 500; });
    Print("placed", recorder.Get<FLiveLinkTransformFrameData>("ManipNet_actor_cube").Transform);
    settings.Delivery = EManipNetDelivery::Raw;
    settings.Origin = FVector(0, 0, 0);
    settings.Yaw = 0;
    source.OnSettingsChanged(&settings, FPropertyChangedEvent());
    for (int i = 0; i < 1000 && !recorder.OtherThread; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const int before = recorder.Frames;
    for (int i = 0; i < 1000 && recorder.Frames < before + 30; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const auto hand = recorder.Get<FLiveLinkAnimationFrameData>("ManipNet_actor_left");
    std::cout << "raw " << (recorder.Frames >= before + 30) << " " << (hand.WorldTime.GetSourceTime() > 0.0) << " "
              << settings.BufferSettings.EngineTimeOffset << "\n";
    std::cout << "preset " << settings.ConnectionString.Value << "\n";
    const FString address = settings.Address;
    settings.Address = "nowhere";
    source.OnSettingsChanged(&settings, FPropertyChangedEvent());
    std::cout << "refused " << source.GetSourceStatus().ToString().Value << "\n";
    settings.Address = address;
    settings.Delivery = EManipNetDelivery::Smooth;
    source.OnSettingsChanged(&settings, FPropertyChangedEvent());
    TickUntil(source, [&] { return source.IsSourceStillValid(); });
}

}  // namespace

int main(int, char** words) {
    const UManipNetLiveLinkSourceFactory factory;
    TSharedPtr<ILiveLinkSource> source;
    std::string preset;
    const auto panel = std::dynamic_pointer_cast<SHorizontalBox>(factory.BuildCreationPanel({[&](auto made, FString text) {
        source = made;
        preset = text.Value;
    }}));
    std::dynamic_pointer_cast<SEditableTextBox>(panel->Children[0])->Set(FText::FromString(words[1]));
    std::dynamic_pointer_cast<SButton>(panel->Children[1])->Click();
    source = factory.CreateSource(preset.c_str());  // a preset does the same

    Recorder recorder;
    source->ReceiveClient(&recorder, FGuid());
    std::cout << "valid at first " << source->IsSourceStillValid() << "\n";
    const std::string left = "ManipNet_actor_left", right = "ManipNet_actor_right", cube = "ManipNet_actor_cube";
    TickUntil(*source, [&] { return recorder.Has(left) && recorder.Has(right) && recorder.Has(cube); });
    for (int i = 0; i < 10; ++i) source->Update();
    auto& skeleton = *recorder.Static.at(left).Cast<FLiveLinkSkeletonStaticData>();
    const auto hand = recorder.Get<FLiveLinkAnimationFrameData>(left);
    std::cout << "described " << recorder.Described << "\n";
    std::cout << "bones " << skeleton.BoneNames.size() << " " << skeleton.BoneParents.size() << " " << hand.Transforms.size()
              << "\nroot " << skeleton.BoneNames[0].Value << " " << skeleton.BoneParents[0] << "\n";
    std::cout << "weight " << skeleton.PropertyNames[0].Value << " " << hand.PropertyValues[0] << "\n";
    Print("wrist", hand.Transforms[0]);
    Print("body", recorder.Get<FLiveLinkTransformFrameData>(cube).Transform);
    PrintTimecode(hand.MetaData.SceneTime);
    std::cout << "machine " << source->GetSourceMachineName().ToString().Value << "\n";
    std::cout << "status " << source->GetSourceStatus().ToString().Value << "\n";
    recorder.Remove(left);
    TickUntil(*source, [&] { return recorder.Has(left); });
    std::cout << "described again " << recorder.Has(left) << " " << recorder.Described << "\n";
    ChangeSettings(*source, recorder);
    std::cout << "valid " << source->IsSourceStillValid();
    bool closed = false;
    for (int i = 0; i < 1000 && !closed; ++i) {
        closed = source->RequestSourceShutdown();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    std::cout << closed << source->IsSourceStillValid() << "\n";
    std::cout << "wrong " << factory.CreateSource("udp://x")->GetSourceStatus().ToString().Value << "\n";
    const auto silent = factory.CreateSource("tcp://127.0.0.1:1");
    silent->ReceiveClient(&recorder, FGuid());
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    std::cout << "silent " << silent->IsSourceStillValid() << "\n";
    while (!silent->RequestSourceShutdown()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}
