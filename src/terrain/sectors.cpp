#include "terrain/sectors.hpp"
