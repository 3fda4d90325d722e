// Runs the plugin's source and factory on stubs of the engine with a live server: `glue ADDRESS`.
#include <chrono>
#include <iostream>
#include <map>
#include <thread>

#include "ManipNetLiveLinkSource.h"
#include "ManipNetLiveLinkSourceFactory.h"

namespace {

struct Recorder : ILiveLinkClient {
    std::map<std::string, FLiveLinkStaticDataStruct> Static;
    std::map<std::string, FLiveLinkFrameDataStruct> Newest;
    int Described = 0;

    void PushSubjectStaticData_AnyThread(const FLiveLinkSubjectKey& key, UClass*, FLiveLinkStaticDataStruct&& data) override {
        ++Described;
        Static.insert_or_assign(key.SubjectName.Value, std::move(data));
    }
    void PushSubjectFrameData_AnyThread(const FLiveLinkSubjectKey& key, FLiveLinkFrameDataStruct&& data) override {
        Newest.insert_or_assign(key.SubjectName.Value, std::move(data));
    }
};

void Print(const std::string& what, const FTransform& t) {
    std::cout << what << " " << t.Translation.X << " " << t.Translation.Y << " " << t.Translation.Z << " " << t.Rotation.X
              << " " << t.Rotation.Y << " " << t.Rotation.Z << " " << t.Rotation.W << "\n";
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
    for (int i = 0; i < 1000 && recorder.Newest.size() < 3; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        source->Update();
    }
    for (int i = 0; i < 10; ++i) source->Update();
    auto& skeleton = *recorder.Static.at("ManipNet_actor_left").Cast<FLiveLinkSkeletonStaticData>();
    auto& hand = *recorder.Newest.at("ManipNet_actor_left").Cast<FLiveLinkAnimationFrameData>();
    std::cout << "described " << recorder.Described << "\n";
    std::cout << "bones " << skeleton.BoneNames.size() << " " << skeleton.BoneParents.size() << " " << hand.Transforms.size()
              << "\nroot " << skeleton.BoneNames[0].Value << " " << skeleton.BoneParents[0] << "\n";
    std::cout << "weight " << skeleton.PropertyNames[0].Value << " " << hand.PropertyValues[0] << "\n";
    Print("wrist", hand.Transforms[0]);
    Print("body", recorder.Newest.at("ManipNet_actor_cube").Cast<FLiveLinkTransformFrameData>()->Transform);
    std::cout << "machine " << source->GetSourceMachineName().ToString().Value << "\n";
    std::cout << "status " << source->GetSourceStatus().ToString().Value << "\n";
    std::cout << "valid " << source->IsSourceStillValid() << source->RequestSourceShutdown() << source->IsSourceStillValid() << "\n";
    std::cout << "wrong " << factory.CreateSource("udp://x")->GetSourceStatus().ToString().Value << "\n";
}
