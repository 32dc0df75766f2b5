#include "terrain/components.hpp"
