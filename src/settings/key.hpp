// One configuration key: its name, unit, range, default and help, and how a text becomes its value.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace groundline::settings {

struct Settings;

// A row of the one table from which help, the sample file and the reading of values are made.
struct Key {
    std::string name;   // dotted, e.g. terrain.tolerance_m; its unit is in the name
    std::string range;  // what is accepted, for people: "0.01 .. 2", "on | off"
    std::string help;   // one sentence
    // Sets the value from its text. Returns false where the text is outside `range`.
    std::function<bool(Settings&, std::string_view)> parse = {};
    std::function<std::string(const Settings&)> print = {};
    bool reloadable = false;  // may change between two frames of a running daemon; the others need a restart
};

// The table, in the order of the sample file.
const std::vector<Key>& keys();
const Key* find_key(std::string_view name);
// The known name with the fewest edits from `name`.
std::string nearest_key(std::string_view name);

}  // namespace groundline::settings
