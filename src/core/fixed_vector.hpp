// A vector with its room inside: the record types of a frame allocate nothing.
#pragma once

#include <boost/container/static_vector.hpp>
#include <cstddef>

namespace groundline {

template <typename T, std::size_t kCapacity>
using FixedVector = boost::container::static_vector<T, kCapacity>;

}  // namespace groundline
