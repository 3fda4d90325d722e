#include "ArmIk.h"

#include <algorithm>

namespace manipnet {
namespace {

/// A direction in which the elbow of a straight arm bends: any one across the arm.
Vec AnyAcross(const Vec& along) { return Unit(Cross(along, std::fabs(along.Z) < 0.7 ? Vec{0.0, 0.0, 1.0} : Vec{1.0, 0.0, 0.0})); }

}  // namespace

ArmTurn SolveArm(const Vec& shoulder, const Vec& elbow, const Vec& wrist, const Vec& target) {
    const double upper = Length(elbow - shoulder);
    const double lower = Length(wrist - elbow);
    const Vec along = Unit(target - shoulder);
    const double reach = std::min(std::max(Length(target - shoulder), std::fabs(upper - lower)), upper + lower);
    const Quat swing = FromTo(wrist - shoulder, target - shoulder);
    const Vec swung = Rotate(swing, elbow - shoulder);
    const Vec aside = swung - Dot(swung, along) * along;
    const Vec bend = Length(aside) > 1e-6 * upper ? Unit(aside) : AnyAcross(along);
    const double forth = reach > 0.0 ? (upper * upper - lower * lower + reach * reach) / (2.0 * reach) : 0.0;
    const double out = std::sqrt(std::max(upper * upper - forth * forth, 0.0));
    const Vec newElbow = forth * along + out * bend;  // relative to the shoulder
    ArmTurn turn;
    turn.Upper = FromTo(swung, newElbow) * swing;
    turn.Lower = FromTo(Rotate(turn.Upper, wrist - elbow), reach * along - newElbow) * turn.Upper;
    return turn;
}

}  // namespace manipnet
