// Runs the engine-free core for the tests, which talk to it in lines of text: `decode FILES`, `interpolate`, `axes`,
// `live ADDRESS` and others.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "ArmIk.h"
#include "AvatarClient.h"
#include "Axes.h"
#include "BoneNames.h"
#include "Client.h"
#include "ControlClient.h"
#include "Decoder.h"
#include "HandProfile.h"
#include "Interpolator.h"
#include "Json.h"
#include "LocalClock.h"
#include "Skeleton.h"
#include "SubjectHand.h"
#include "Timecode.h"

using namespace manipnet;

namespace {

std::atomic<long> Allocations{0};

std::string Number(double value, const char* format = "%.17g") {
    char text[40];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

template <typename Values>
std::string Floats(const Values& values) {
    std::string text = "[";
    for (const float value : values) text += (text.size() > 1 ? "," : "") + Number(static_cast<double>(value), "%.9g");
    return text + "]";
}

std::string Quote(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) out += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    return out + "\"";
}

std::string Describe(const HandsFrame& frame) {
    std::string text = "{\"session\":" + Quote(frame.Session.Text) + ",\"actor\":" + Quote(frame.Actor.Text);
    text += ",\"seq\":" + std::to_string(frame.Seq) + ",\"t_capture\":" + Number(frame.TCapture);
    text += ",\"t_publish\":" + Number(frame.TPublish) + ",\"look_ahead\":" + Number(frame.LookAhead);
    text += ",\"latency_ms\":" + Floats(frame.LatencyMs) + ",\"hands\":{";
    std::string comma;
    for (const Side side : {Side::Left, Side::Right}) {
        const HandFrame& hand = frame.Hand(side);
        if (!hand.Present) continue;
        text += comma + (side == Side::Left ? "\"left\"" : "\"right\"");
        text += ":{\"state\":" + Quote(layout::kStates[hand.State]);
        text += ",\"object\":" + (hand.HasObject ? Quote(hand.Object.Text) : "null");
        text += ",\"scale\":" + Number(static_cast<double>(hand.Scale)) + ",\"angles\":" + Floats(hand.Angles);
        text += ",\"rotations\":" + Floats(hand.Rotations) + ",\"wrist\":" + Floats(hand.Wrist);
        text += ",\"joints\":" + Floats(hand.Joints) + "}";
        comma = ",";
    }
    text += "},\"bodies\":[";
    for (std::size_t i = 0; i < frame.BodyCount; ++i) {
        const BodyFrame& body = frame.Bodies[i];
        text += (i > 0 ? "," : "") + std::string("{\"name\":") + Quote(body.BodyName.Text);
        text += ",\"tracked\":" + std::string(body.Tracked ? "true" : "false") + ",\"pose\":" + Floats(body.Pose) + "}";
    }
    return text + "]}";
}

void DecodeFile(const char* path) {
    std::ifstream file(path, std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    // A heap copy of exact size lets the sanitizer notice reads beyond the end.
    const std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
    HandsFrame frame;
    const std::string error = Decode(data.data(), data.size(), frame);
    std::cout << (error.empty() ? Describe(frame) : "{\"error\":" + Quote(error) + "}") << "\n";
}

std::vector<std::uint8_t> FromHex(const std::string& hex) {
    std::vector<std::uint8_t> data(hex.size() / 2);
    for (std::size_t i = 0; i < data.size(); ++i)
        data[i] = static_cast<std::uint8_t>(std::strtoul(hex.substr(2 * i, 2).c_str(), nullptr, 16));
    return data;
}

void Interpolate() {
    Interpolator interpolator;
    auto spare = std::make_unique<HandsFrame>();
    HandsFrame shown;
    std::string verb;
    double value = 0.0;
    while (std::cin >> verb >> value) {
        if (verb == "delay") interpolator.DelayS = value;
        if (verb == "push") {
            std::string hex;
            std::cin >> hex;
            const std::vector<std::uint8_t> data = FromHex(hex);
            if (!Decode(data.data(), data.size(), *spare).empty()) std::abort();
            std::cout << (interpolator.Push(spare, value) ? 1 : 0) << "\n";
        }
        if (verb == "show") {
            float weight = 0.0F;
            if (!interpolator.Sample(value, shown, weight)) {
                std::cout << "none\n";
                continue;
            }
            const HandFrame& hand = shown.Hand(Side::Left);
            std::cout << Number(static_cast<double>(weight)) << " " << shown.Seq;
            for (const float x : {hand.Wrist[0], hand.Wrist[5], hand.Wrist[6], hand.Angles[3], hand.Joints[7 * 25],
                                  shown.Bodies[0].Pose[0]})
                std::cout << " " << Number(static_cast<double>(x));
            std::cout << "\n";
        }
    }
}

void Axes() {
    float pose[7];
    while (std::cin >> pose[0] >> pose[1] >> pose[2] >> pose[3] >> pose[4] >> pose[5] >> pose[6]) {
        const UnrealPose p = ToUnreal(pose);
        for (const double x : {p.X, p.Y, p.Z, p.QX, p.QY, p.QZ, p.QW}) std::cout << Number(x) << " ";
        std::cout << "\n";
    }
}

/// Reads a message in hex and prints name, parent and local pose of every bone of the left hand.
void DescribeSkeleton() {
    std::string hex;
    std::cin >> hex;
    const std::vector<std::uint8_t> data = FromHex(hex);
    HandsFrame frame;
    if (!Decode(data.data(), data.size(), frame).empty()) std::abort();
    Skeleton::Poses poses;
    Skeleton::LocalPoses(frame.Hand(Side::Left), Placement(), poses);
    for (std::size_t bone = 0; bone < Skeleton::kBones; ++bone) {
        const UnrealPose& p = poses[bone];
        std::cout << Skeleton::BoneName(bone) << " " << Skeleton::ParentOf(bone);
        for (const double x : {p.X, p.Y, p.Z, p.QX, p.QY, p.QZ, p.QW}) std::cout << " " << Number(x);
        std::cout << "\n";
    }
}

/// Prints the meaning of each line as a connection string.
void Connections() {
    for (std::string line; std::getline(std::cin, line);) {
        Connection to;
        const std::string error = ParseConnection(line, to);
        if (!error.empty()) std::cout << "error: " << error << "\n";
        else
            std::cout << to.Host << " " << to.Port << " '" << to.Actor << "' " << to.DelayS << " | " << FormatConnection(to) << "\n";
    }
}

std::string Describe(const std::string& text, double rate) {
    Timecode t;
    if (!ParseTimecode(text, rate, t)) return "none";
    std::ostringstream out;
    out << t.Hours << " " << t.Minutes << " " << t.Seconds << " " << t.Frames << " " << t.DropFrame << " " << t.Numerator << "/"
        << t.Denominator;
    return out.str();
}

/// Prints the timecode of a message, its rate and their meaning.
void TimecodeOf(const char* path) {
    std::ifstream file(path, std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    const std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
    HandsFrame frame;
    if (!Decode(data.data(), data.size(), frame).empty()) std::abort();
    const double rate = static_cast<double>(frame.TimecodeRate);
    std::cout << frame.TimecodeText.Text << " " << rate << " " << Describe(frame.TimecodeText.Text, rate) << "\n";
}

/// Prints the meaning of each line with a timecode and a rate.
void Timecodes() {
    std::string text;
    double rate = 0.0;
    while (std::cin >> text >> rate) std::cout << Describe(text, rate) << "\n";
}

/// Prints which bone each name means, as side, finger and part.
void Names() {
    for (std::string line; std::getline(std::cin, line);) {
        std::string found = "none";
        for (const Side side : {Side::Left, Side::Right}) {
            const std::string word = side == Side::Left ? "Left " : "Right ";
            if (IsHandName(line, side)) found = word + "hand";
            for (std::size_t bone = 0; bone < kFingerBones; ++bone)
                if (MatchesFinger(line, side, bone / 3, bone % 3, false))
                    found = word + std::to_string(bone / 3) + " " + std::to_string(bone % 3);
        }
        std::cout << found << "\n";
    }
}

/// Prints the meaning of each line as a bone map.
void BoneMaps() {
    for (std::string line; std::getline(std::cin, line);) {
        BoneMap map;
        const std::string error = ParseBoneMap(line, map);
        if (!error.empty()) std::cout << "error: " << error << "\n";
        else {
            for (const auto& [name, bone] : map) std::cout << name << "=" << bone << ";";
            std::cout << "\n";
        }
    }
}

/// Reads shoulder, elbow, wrist and target; prints where elbow and wrist arrive.
void Arms() {
    Vec shoulder, elbow, wrist, target;
    const auto read = [](Vec& v) { return static_cast<bool>(std::cin >> v.X >> v.Y >> v.Z); };
    while (read(shoulder) && read(elbow) && read(wrist) && read(target)) {
        const ArmTurn turn = SolveArm(shoulder, elbow, wrist, target);
        const Vec newElbow = shoulder + Rotate(turn.Upper, elbow - shoulder);
        const Vec newWrist = newElbow + Rotate(turn.Lower, wrist - elbow);
        for (const Vec& v : {newElbow, newWrist}) std::cout << Number(v.X) << " " << Number(v.Y) << " " << Number(v.Z) << " ";
        std::cout << "\n";
    }
}

bool Connect(const std::string& address, Connection& to) {
    const std::string error = ParseConnection(address + " delay=0.05", to);
    if (!error.empty()) std::cerr << error << "\n";
    return error.empty();
}

std::vector<std::string> SplitTabs(const std::string& line) {
    std::vector<std::string> words(1);
    for (const char c : line) {
        if (c == '\t') words.emplace_back();
        else words.back() += c;
    }
    return words;
}

/// Reads lines with a side and the names of bones, separated by tabs; prints the indices of the hand, 15 finger bones and 4
/// metacarpals.
void Find() {
    for (std::string line; std::getline(std::cin, line);) {
        std::vector<std::string> names = SplitTabs(line);
        const Side side = names[0] == "left" ? Side::Left : Side::Right;
        names.erase(names.begin());
        const BoneIndices found = FindBones(names, std::vector<int>(names.size(), -1), side, BoneMap());
        std::cout << found.Hand;
        for (const int bone : found.Fingers) std::cout << " " << bone;
        for (std::size_t finger = 1; finger < kFingers; ++finger) std::cout << " " << found.Metacarpals[finger];
        std::cout << "\n";
    }
}

/// Sends the requests of standard input, one a line, and prints the replies.
int Control(const std::string& address) {
    Connection to;
    if (!ParseConnection(address, to).empty()) return 2;
    const std::atomic<bool> stop{false};
    for (std::string line; std::getline(std::cin, line);) {
        const Answer answer = ControlClient(to.Host, to.Port, stop, 5000).Ask(line);
        std::cout << (answer.Problem.empty() ? answer.Reply : (answer.Refused ? "refused: " : "failed: ") + answer.Problem) << "\n";
    }
    return 0;
}

/// Reads a hand at rest: side, 15 times presence and pose, 5 times presence and tip, the same for metacarpals.
RestHand ReadRest(Side& side) {
    double number = 0.0;
    std::cin >> number;
    side = number > 0.5 ? Side::Right : Side::Left;
    RestHand rest;
    const auto read = [&number](bool& there, Vec& at) {
        std::cin >> number >> at.X >> at.Y >> at.Z;
        there = number > 0.5;
    };
    for (std::size_t i = 0; i < kFingerBones; ++i) {
        Quat& q = rest.Rotations[i];
        read(rest.HasBone[i], rest.Positions[i]);
        std::cin >> q.X >> q.Y >> q.Z >> q.W;
    }
    for (std::size_t i = 0; i < kFingers; ++i) read(rest.HasTip[i], rest.Tips[i]);
    for (std::size_t i = 0; i < kFingers; ++i) read(rest.HasMetacarpal[i], rest.Metacarpals[i]);
    return rest;
}

/// Prints the profile of each hand that is read, or why it has none.
void Profiles() {
    while (std::cin >> std::ws && !std::cin.eof()) {
        Side side = Side::Left;
        const RestHand rest = ReadRest(side);
        HandProfile profile;
        const std::string problem = MakeProfile(side, rest, profile);
        const bool left = side == Side::Left;
        std::cout << (problem.empty() ? ProfileJson("avatar", left ? &profile : nullptr, left ? nullptr : &profile) : "error: " + problem)
                  << "\n";
    }
}

/// The OpenXR joints of a message relative to each other, as the subject's bones in Live Link.
HandPose PoseOf(const HandFrame& hand) {
    Skeleton::Poses poses;
    Skeleton::LocalPoses(hand, Placement(), poses);
    std::vector<std::string> names;
    std::vector<int> parents;
    std::vector<LocalBone> local;
    for (std::size_t bone = 0; bone < Skeleton::kBones; ++bone) {
        names.emplace_back(Skeleton::BoneName(bone));
        parents.push_back(Skeleton::ParentOf(bone));
        local.push_back({RotationOf(poses[bone]), PositionOf(poses[bone])});
    }
    SubjectHand subject;
    if (!subject.Bind(names, parents)) std::abort();
    return subject.Read(local);
}

std::string Doubles(const std::vector<double>& values) {
    std::string text = "[";
    for (const double value : values) text += (text.size() > 1 ? "," : "") + Number(value);
    return text + "]";
}

/// Uploads the profile of the two hands in the first lines and receives them. For each further line it prints the state, the
/// frames received, and for each hand the joints of the message and the hand bone and finger bones of the avatar.
int Avatar(const std::string& address, const std::string& control, const std::string& name) {
    Connection to;
    if (!Connect(address, to)) return 2;
    to.ControlPort = static_cast<std::uint16_t>(std::stoi(control.substr(control.rfind(':') + 1)));
    HandProfile profiles[2];
    HandRig rigs[2];
    for (int i = 0; i < 2; ++i) {
        Side side = Side::Left;
        const RestHand rest = ReadRest(side);
        if (!MakeProfile(side, rest, profiles[i]).empty()) return 3;
        rigs[i] = ExactRig(rest, profiles[i]);
    }
    std::string line;
    std::getline(std::cin, line);
    AvatarClient client(to, name, ProfileJson(name, &profiles[0], &profiles[1]));
    HandsFrame shown;
    while (std::getline(std::cin, line)) {
        float weight = 0.0F;
        const bool any = client.Sample(LocalNow(), shown, weight);
        const Stats stats = client.GetStats();
        std::string text = "{\"state\": " + QuotedJson(stats.State) + ", \"received\": " + std::to_string(stats.Received);
        text += ", \"weight\": " + Number(static_cast<double>(weight));
        for (const Side side : {Side::Left, Side::Right}) {
            const HandFrame& hand = shown.Hand(side);
            if (!any || !hand.Present) continue;
            const HandRig& rig = rigs[static_cast<std::size_t>(side)];
            const HandPose pose = PoseOf(hand);
            const Quat q = rig.HandRotation(pose);
            const Vec& p = pose.WristPosition;
            std::vector<double> bones;
            for (const Quat& b : rig.Solve(pose)) bones.insert(bones.end(), {b.X, b.Y, b.Z, b.W});
            text += side == Side::Left ? ", \"left\": " : ", \"right\": ";
            text += "{\"joints\": " + Floats(hand.Joints) + ", \"hand\": " + Doubles({p.X, p.Y, p.Z, q.X, q.Y, q.Z, q.W});
            text += ", \"bones\": " + Doubles(bones) + "}";
        }
        std::cout << text << "}" << std::endl;
    }
    client.Stop();
    std::cout << "closed" << std::endl;
    return 0;
}

/// Shows hands as a program would, and records what it received and showed. Only answers allocate.
class Show {
public:
    explicit Show(Client& client) : From(client), Noted(1 << 16) {}

    void Step() {
        const Stats stats = From.GetStats();
        const double now = LocalNow();
        if (stats.Received > 0 && stats.Seq != Seq && Count < Noted.size()) {
            Seq = stats.Seq;
            Noted[Count++] = {Seq, now - stats.AgeS};
        }
        if (now < Due) return;
        Due = now + 1.0 / 90.0;
        if (From.Sample(now, Shown, Weight)) ++Shows;
    }

    std::string Arrivals() {
        std::string text = "[";
        for (std::size_t i = 0; i < Count; ++i)
            text += (i > 0 ? ",[" : "[") + std::to_string(Noted[i].first) + "," + Number(Noted[i].second) + "]";
        Count = 0;
        return text + "]";
    }

    std::string Figures() const {
        const long allocations = Allocations;
        const Stats s = From.GetStats();
        std::ostringstream out;
        out << "{\"state\":" << Quote(s.State) << ",\"received\":" << s.Received << ",\"lost\":" << s.Lost << ",\"late\":" << s.Late
            << ",\"refused\":" << s.Refused << ",\"connections\":" << s.Connections << ",\"seq\":" << s.Seq
            << ",\"rate_hz\":" << Number(s.RateHz) << ",\"age_s\":" << (s.AgeS < 0 ? "null" : Number(s.AgeS))
            << ",\"transit_s\":" << Number(s.TransitS) << ",\"weight\":" << Number(static_cast<double>(Weight))
            << ",\"shown_seq\":" << Shown.Seq << ",\"session\":" << Quote(Shown.Session.Text) << ",\"shows\":" << Shows
            << ",\"allocations\":" << allocations << "}";
        return out.str();
    }

private:
    Client& From;
    HandsFrame Shown;
    std::vector<std::pair<std::uint64_t, double>> Noted;
    std::size_t Count = 0;
    std::uint64_t Seq = 0;
    double Due = 0.0;
    float Weight = 0.0F;
    long Shows = 0;
};

/// Shows at about 90 Hz until standard input ends. Answers "arrivals" with number and time of every frame since the
/// last time, and any other line with figures.
int Live(const std::string& address) {
    Connection to;
    if (!Connect(address, to)) return 2;
    enum { kNothing, kFigures, kArrivals };
    std::atomic<int> asked{kNothing};
    std::atomic<bool> ended{false};
    std::thread asking([&] {
        for (std::string line; std::getline(std::cin, line);) asked = line == "arrivals" ? kArrivals : kFigures;
        ended = true;
    });
    {
        Client client(to);
        Show show(client);
        while (!ended) {
            show.Step();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            const int what = asked.exchange(kNothing);
            if (what == kNothing) continue;
            std::cout << (what == kArrivals ? show.Arrivals() : show.Figures()) << std::endl;
            Allocations = 0;  // the allocations of answers do not count
        }
    }
    asking.join();
    std::cout << "closed" << std::endl;
    return 0;
}

/// Blocks the main thread and shows nothing; prints figures for every line of standard input.
int Idle(const std::string& address) {
    Connection to;
    if (!Connect(address, to)) return 2;
    {
        Client client(to);
        const Show show(client);
        for (std::string line; std::getline(std::cin, line);) std::cout << show.Figures() << std::endl;
    }
    std::cout << "closed" << std::endl;
    return 0;
}

}  // namespace

// Not inlined: some compilers believe that a new of their own does not match this delete when only one of them is.
__attribute__((noinline)) void* operator new(std::size_t size) {
    ++Allocations;
    if (void* memory = std::malloc(size)) return memory;
    std::abort();
}
__attribute__((noinline)) void operator delete(void* memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

int main(int count, char** words) {
    const std::string verb = count > 1 ? words[1] : "";
    if (verb == "decode") {
        for (int i = 2; i < count; ++i) DecodeFile(words[i]);
    } else if (verb == "interpolate") {
        Interpolate();
    } else if (verb == "axes") {
        Axes();
    } else if (verb == "skeleton") {
        DescribeSkeleton();
    } else if (verb == "connections") {
        Connections();
    } else if (verb == "timecode") {
        for (int i = 2; i < count; ++i) TimecodeOf(words[i]);
    } else if (verb == "timecodes") {
        Timecodes();
    } else if (verb == "names") {
        Names();
    } else if (verb == "bone_maps") {
        BoneMaps();
    } else if (verb == "arms") {
        Arms();
    } else if (verb == "find") {
        Find();
    } else if (verb == "profile") {
        Profiles();
    } else if (verb == "control" && count == 3) {
        return Control(words[2]);
    } else if (verb == "avatar" && count == 5) {
        return Avatar(words[2], words[3], words[4]);
    } else if (verb == "live" && count == 3) {
        return Live(words[2]);
    } else if (verb == "idle" && count == 3) {
        return Idle(words[2]);
    } else {
        return 2;
    }
    return 0;
}
