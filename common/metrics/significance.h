#pragma once
// Student's t and the normal distribution, and Sidak's correction, by which tests and cross-checks decide. They use
// libm, so that nothing that ends up in a picture may use them.

namespace lightloom {

/// The level of each of `count` independent tests whose family-wise level is `level`, in (0, 1).
double sidak(double level, int count);

/// Two-sided p-value of a standard normal deviate.
double normal_p_value(double z);

/// Two-sided p-value of Student's t with `degrees` of freedom, which may be infinite (the normal distribution).
double student_p_value(double t, double degrees);

/// The deviate whose two-sided p-value is `p`, which lies in (0, 1).
double student_quantile(double p, double degrees);

}  // namespace lightloom
