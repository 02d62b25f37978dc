#include "common/metrics/significance.h"

#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace lightloom {

namespace {

namespace policies = boost::math::policies;

/// Undefined results are NaN or infinite, as in the rest of our arithmetic, instead of an exception.
using NoThrow =
    policies::policy<policies::domain_error<policies::ignore_error>, policies::pole_error<policies::ignore_error>,
                     policies::overflow_error<policies::ignore_error>, policies::evaluation_error<policies::ignore_error>>;
using Normal = boost::math::normal_distribution<double, NoThrow>;
using Student = boost::math::students_t_distribution<double, NoThrow>;

}  // namespace

double sidak(double level, int count) { return -std::expm1(std::log1p(-level) / count); }

double normal_p_value(double z) { return 2 * cdf(complement(Normal(), std::fabs(z))); }

double student_p_value(double t, double degrees) { return 2 * cdf(complement(Student(degrees), std::fabs(t))); }

double student_quantile(double p, double degrees) { return quantile(complement(Student(degrees), p / 2)); }

}  // namespace lightloom
