// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/optimality_certificate.hpp"

#include <cstddef>

#include <Eigen/Eigenvalues>

namespace wrenchd {

Eigen::Matrix4d dual_matrix(const Matrix3d& H_hat, std::span<const LocalContact> contacts,
                            std::span<const double> multipliers) noexcept {
  Eigen::Matrix4d Z = Eigen::Matrix4d::Zero();
  Z.bottomRightCorner<3, 3>() = 4.0 * H_hat;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const double m = multipliers[i];
    if (!(m > 0.0)) continue;
    const Vector3d& n = contacts[i].n;
    const Vector3d& a = contacts[i].a;
    const Vector3d an = a.cross(n);
    const Matrix3d na = n * a.transpose();
    Z(0, 0) -= m * n.dot(a);
    Z.topRightCorner<1, 3>() -= m * an.transpose();
    Z.bottomLeftCorner<3, 1>() -= m * an;
    Z.bottomRightCorner<3, 3>() -= m * (na + na.transpose() - n.dot(a) * Matrix3d::Identity());
  }
  return Z;
}

Quaterniond dual_rotation(const Matrix3d& H_hat, std::span<const LocalContact> contacts,
                          std::span<const double> multipliers) noexcept {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(dual_matrix(H_hat, contacts, multipliers));
  const Eigen::Vector4d q = eigen.eigenvectors().col(0);
  return {q[0], q[1], q[2], q[3]};
}

bool has_dual_bound(std::span<const LocalContact> contacts, std::span<const double> multipliers) noexcept {
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (multipliers[i] > 0.0 && contacts[i].kind != ContactKind::vertex_face) return false;
  return true;
}

bool meets_dual_bound(const HessianBlocks& lagrangian_hessian) noexcept {
  CholeskyFactor factor;
  return factorise(lagrangian_hessian, factor);
}

}  // namespace wrenchd
