groundline_test(core
  SOURCES unit/core_ground_test.cpp unit/core_half_size_test.cpp unit/core_math_test.cpp unit/core_memory_test.cpp support/allocation_count.cpp
  USES core)
