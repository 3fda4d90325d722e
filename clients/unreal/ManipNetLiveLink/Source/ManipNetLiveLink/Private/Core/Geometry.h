#pragma once

#include <cmath>

namespace manipnet {

struct Vec {
    double X = 0.0, Y = 0.0, Z = 0.0;
};

inline Vec operator+(const Vec& a, const Vec& b) { return {a.X + b.X, a.Y + b.Y, a.Z + b.Z}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a.X - b.X, a.Y - b.Y, a.Z - b.Z}; }
inline Vec operator*(double s, const Vec& v) { return {s * v.X, s * v.Y, s * v.Z}; }
inline double Dot(const Vec& a, const Vec& b) { return a.X * b.X + a.Y * b.Y + a.Z * b.Z; }
inline Vec Cross(const Vec& a, const Vec& b) {
    return {a.Y * b.Z - a.Z * b.Y, a.Z * b.X - a.X * b.Z, a.X * b.Y - a.Y * b.X};
}
inline double Length(const Vec& v) { return std::sqrt(Dot(v, v)); }
inline Vec Unit(const Vec& v) { return (1.0 / std::fmax(Length(v), 1e-12)) * v; }

/// A unit quaternion. The product `a * b` is the rotation b followed by a, as in Unreal's FQuat.
struct Quat {
    double X = 0.0, Y = 0.0, Z = 0.0, W = 1.0;
};

inline Quat Inverse(const Quat& q) { return {-q.X, -q.Y, -q.Z, q.W}; }

inline Quat operator*(const Quat& a, const Quat& b) {
    return {a.W * b.X + a.X * b.W + a.Y * b.Z - a.Z * b.Y, a.W * b.Y - a.X * b.Z + a.Y * b.W + a.Z * b.X,
            a.W * b.Z + a.X * b.Y - a.Y * b.X + a.Z * b.W, a.W * b.W - a.X * b.X - a.Y * b.Y - a.Z * b.Z};
}

inline Vec Rotate(const Quat& q, const Vec& v) {
    const Vec u{q.X, q.Y, q.Z};
    const Vec t = 2.0 * Cross(u, v);
    return v + q.W * t + Cross(u, t);
}

inline Quat Normalized(const Quat& q) {
    const double s = 1.0 / std::sqrt(q.X * q.X + q.Y * q.Y + q.Z * q.Z + q.W * q.W);
    return {s * q.X, s * q.Y, s * q.Z, s * q.W};
}

/// The shortest rotation from one direction to another.
inline Quat FromTo(const Vec& from, const Vec& to) {
    const Vec a = Unit(from);
    const Vec b = Unit(to);
    const double w = 1.0 + Dot(a, b);
    if (w > 1e-9) {
        const Vec axis = Cross(a, b);
        return Normalized({axis.X, axis.Y, axis.Z, w});
    }
    // opposite directions: half a turn about any perpendicular axis
    const Vec axis = Unit(Cross(a, std::fabs(a.X) < 0.7 ? Vec{1.0, 0.0, 0.0} : Vec{0.0, 1.0, 0.0}));
    return {axis.X, axis.Y, axis.Z, 0.0};
}

/// The rotation `part` of the way from a to b, along a straight line of quaternions and the shorter way round.
inline Quat Blend(const Quat& a, const Quat& b, double part) {
    const double sign = a.X * b.X + a.Y * b.Y + a.Z * b.Z + a.W * b.W < 0.0 ? -part : part;
    const double rest = 1.0 - part;
    return Normalized(
        {rest * a.X + sign * b.X, rest * a.Y + sign * b.Y, rest * a.Z + sign * b.Z, rest * a.W + sign * b.W});
}

/// A bone relative to its parent, or to another ancestor.
struct LocalBone {
    Quat Rotation;
    Vec Translation;
    double Scale = 1.0;
};

/// A bone of `parent` in the space of that one's own parent.
inline LocalBone Then(const LocalBone& parent, const LocalBone& child) {
    const Vec offset = Rotate(parent.Rotation, parent.Scale * child.Translation);
    return {parent.Rotation * child.Rotation, parent.Translation + offset, parent.Scale * child.Scale};
}

}  // namespace manipnet
