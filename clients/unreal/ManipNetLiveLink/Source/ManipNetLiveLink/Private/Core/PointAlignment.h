#pragma once

#include <array>
#include <vector>

#include "Geometry.h"

namespace manipnet {

/// The rotation about the origin that turns the points `from` nearest to `to`, in the sense of least squares. Source: B. K.
/// P. Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987.
inline Quat AlignPoints(const std::vector<Vec>& from, const std::vector<Vec>& to) {
    using Matrix = std::array<std::array<double, 4>, 4>;
    double s[3][3] = {};
    for (std::size_t i = 0; i < from.size(); ++i) {
        const double a[3] = {from[i].X, from[i].Y, from[i].Z};
        const double b[3] = {to[i].X, to[i].Y, to[i].Z};
        for (int row = 0; row < 3; ++row)
            for (int column = 0; column < 3; ++column) s[row][column] += a[row] * b[column];
    }
    const double x = s[1][2] - s[2][1], y = s[2][0] - s[0][2], z = s[0][1] - s[1][0];
    const double xy = s[0][1] + s[1][0], yz = s[1][2] + s[2][1], zx = s[2][0] + s[0][2];
    Matrix n{{{s[0][0] + s[1][1] + s[2][2], x, y, z},
              {x, s[0][0] - s[1][1] - s[2][2], xy, zx},
              {y, xy, s[1][1] - s[0][0] - s[2][2], yz},
              {z, zx, yz, s[2][2] - s[0][0] - s[1][1]}}};
    double norm = 0.0;
    for (const auto& row : n)
        for (const double value : row) norm += value * value;
    for (std::size_t i = 0; i < 4; ++i) n[i][i] += std::sqrt(norm);  // all eigenvalues are positive now
    constexpr int kSquarings = 40;
    for (int k = 0; k < kSquarings; ++k) {  // until only the largest eigenvalue counts
        Matrix square{};
        double trace = 0.0;
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < 4; ++j)
                for (std::size_t m = 0; m < 4; ++m) square[i][j] += n[i][m] * n[m][j];
            trace += square[i][i];
        }
        for (auto& row : square)
            for (double& value : row) value /= trace;
        n = square;
    }
    std::size_t longest = 0;  // each column is a multiple of the eigenvector
    for (std::size_t i = 1; i < 4; ++i)
        if (n[i][i] > n[longest][longest]) longest = i;
    return Normalized({n[1][longest], n[2][longest], n[3][longest], n[0][longest]});
}

}  // namespace manipnet
