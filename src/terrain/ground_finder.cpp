#include "terrain/ground_finder.hpp"
