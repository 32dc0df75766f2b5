#include "terrain/hough.hpp"
