// Puts hands on a character by the source and the retarget asset, on stubs of the engine, where the server solves on the
// character's skeletal mesh: `avatar TEXT`, with the source's text. Standard input has the path of the mesh and the number
// of its bones, then for each a name, the parent's number, local position and quaternion at rest, and the scale. Each
// further line is answered by the source's status, the places of all bones in the character, and the joints of both subjects.
// A line "request ADDRESS JSON" sends a request from a Blueprint's node instead, and prints its pin and text.
#include <chrono>
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>
#include <thread>

#include "Core/Geometry.h"
#include "ManipNetLiveLinkSource.h"
#include "ManipNetRequest.h"
#include "ManipNetRetargetAsset.h"

namespace {

struct Recorder : ILiveLinkClient {
    std::map<std::string, FLiveLinkStaticDataStruct> Static;
    std::map<std::string, FLiveLinkFrameDataStruct> Newest;

    void PushSubjectStaticData_AnyThread(
        const FLiveLinkSubjectKey& key, TSubclassOf<ULiveLinkRole>, FLiveLinkStaticDataStruct&& data) override {
        Static.insert_or_assign(key.SubjectName.Name.Value, std::move(data));
    }
    void PushSubjectFrameData_AnyThread(const FLiveLinkSubjectKey& key, FLiveLinkFrameDataStruct&& data) override {
        Newest.insert_or_assign(key.SubjectName.Name.Value, std::move(data));
    }
    TArray<FLiveLinkSubjectKey> GetSubjects(bool, bool) const override {
        TArray<FLiveLinkSubjectKey> keys;
        for (const auto& entry : Static) keys.Add(FLiveLinkSubjectKey(FGuid(), FName(entry.first.c_str())));
        return keys;
    }
};

manipnet::LocalBone ToLocal(const FTransform& t) {
    const FQuat q = t.GetRotation();
    return {{q.X, q.Y, q.Z, q.W}, {t.Translation.X, t.Translation.Y, t.Translation.Z}, t.Scale3D.X};
}

/// Prints positions of bones in the space of their root, from poses relative to their parents.
void PrintPlaces(const std::string& what, const TArray<FTransform>& local, const std::vector<int>& parents) {
    std::vector<manipnet::LocalBone> placed;
    std::cout << ", \"" << what << "\": [";
    for (std::size_t i = 0; i < local.size(); ++i) {
        const manipnet::LocalBone own = ToLocal(local[static_cast<int32>(i)]);
        placed.push_back(parents[i] < 0 ? own : manipnet::Then(placed[static_cast<std::size_t>(parents[i])], own));
        const manipnet::Vec& p = placed.back().Translation;
        std::cout << (i > 0 ? "," : "") << p.X << "," << p.Y << "," << p.Z;
    }
    std::cout << "]";
}

void Request(std::istringstream& words) {
    std::string address, json, result;
    words >> address;
    std::getline(words, json);
    UManipNetRequest* node = json == " record" ? UManipNetRequest::StartRecording("a take", address.c_str())
                             : json == " stop" ? UManipNetRequest::StopRecording(address.c_str())
                             : json == " pause" ? UManipNetRequest::Pause(true, address.c_str())
                             : json == " select" ? UManipNetRequest::SelectObject("Box", "mug \"x\"", 1.5, address.c_str())
                                                : UManipNetRequest::SendRequest(json.c_str(), address.c_str());
    node->Replied.Bound.push_back([&](const FString& text) { result = "replied " + text.Value; });
    node->Refused.Bound.push_back([&](const FString& text) { result = "refused " + text.Value; });
    node->Activate();
    for (int i = 0; i < 2000 && result.empty(); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        RunGameThread();
    }
    std::cout << result << (node->Ready ? "" : " (not ready to be destroyed)") << std::endl;
    delete node;
}

}  // namespace

int main(int, char** words) {
    USkeletalMesh mesh;
    std::string path, name, line;
    std::size_t count = 0;
    std::cin >> path >> count;
    std::vector<int> parents;
    for (std::size_t i = 0; i < count; ++i) {
        int parent = 0;
        double v[8];
        std::cin >> name >> parent;
        for (double& x : v) std::cin >> x;
        FTransform pose(FQuat(v[3], v[4], v[5], v[6]), FVector(v[0], v[1], v[2]));
        pose.Scale3D = FVector(v[7], v[7], v[7]);
        mesh.RefSkeleton.Bones.Add({FName(name.c_str()), parent});
        mesh.RefSkeleton.Pose.Add(pose);
        parents.push_back(parent);
    }
    Assets()[path] = &mesh;
    std::getline(std::cin, line);
    FManipNetLiveLinkSource source{FString(words[1])};
    Recorder recorder;
    source.ReceiveClient(&recorder, FGuid());
    UManipNetWristRetargetAsset asset[2] = {UManipNetWristRetargetAsset(FObjectInitializer()), UManipNetWristRetargetAsset(FObjectInitializer())};
    FCompactPose pose;
    pose.Container.RefSkeleton = &mesh.RefSkeleton;
    for (int i = 0; i < static_cast<int>(count); ++i) pose.Container.Indices.Add(i);
    std::cout.precision(9);
    while (std::getline(std::cin, line)) {
        std::istringstream rest(line);
        if (rest >> name && name == "request") {
            Request(rest);
            continue;
        }
        source.Update();
        std::cout << "{\"status\": \"" << source.GetSourceStatus().ToString().Value << "\"";
        pose.Bones = mesh.RefSkeleton.Pose;
        for (auto& [subject, frame] : recorder.Newest) {
            const auto* animation = frame.Cast<FLiveLinkAnimationFrameData>();
            if (animation == nullptr) continue;
            const auto* skeleton = recorder.Static.at(subject).Cast<FLiveLinkSkeletonStaticData>();
            const bool left = subject.size() > 5 && subject.compare(subject.size() - 5, 5, "_left") == 0;
            asset[left ? 0 : 1].BuildPoseFromAnimationData(0.0F, skeleton, animation, pose);
            PrintPlaces(subject, animation->Transforms, std::vector<int>(skeleton->BoneParents.begin(), skeleton->BoneParents.end()));
        }
        PrintPlaces("bones", pose.Bones, parents);
        std::cout << "}" << std::endl;
    }
    while (!source.RequestSourceShutdown()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::cout << "closed" << std::endl;
}
