#include "terrain/plane_fit.hpp"
