#include "terrain/classifier.hpp"
