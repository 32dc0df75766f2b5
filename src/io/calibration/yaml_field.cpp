#include "io/calibration/yaml_field.hpp"

#include <fmt/format.h>

#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <cmath>
#include <sstream>

namespace groundline::io {
namespace {

namespace tree = boost::property_tree;

// Far more than any calibration has; they bound recursion and work on hostile files.
constexpr int kMostElements = 2000;
constexpr int kMostNumbers = 10000;
constexpr int kDeepest = 32;

int count_elements(const std::string& xml) {
    int count = 0;
    for (std::size_t i = 0; i + 1 < xml.size(); ++i)
        if (xml[i] == '<' && xml[i + 1] != '/' && xml[i + 1] != '?' && xml[i + 1] != '!') ++count;
    return count;
}

// OpenCV's way with XML: an element holds named elements, or elements named "_", or words between blanks.
YAML::Node converted(const tree::ptree& from) {
    YAML::Node to;
    for (const auto& [name, child] : from) {
        if (name == "<xmlattr>" || name == "<xmlcomment>") continue;
        if (name == "_")
            to.push_back(converted(child));
        else
            to[name] = converted(child);
    }
    if (to.IsDefined() && !to.IsNull()) return to;
    std::istringstream words(from.data());
    for (std::string word; words >> word;)
        to.push_back(word);
    if (to.size() == 1) return YAML::Clone(to[0]);
    return to;
}

// Not through cv::FileStorage: 4.6 reads beyond the end of a file that is cut within a tag.
YAML::Node from_xml(const SourceText& source) {
    if (count_elements(source.text) > kMostElements)
        refuse(source.path, 0, fmt::format("more than {} elements, expected OpenCV XML", kMostElements));
    std::istringstream stream(source.text);
    tree::ptree document;
    try {
        tree::read_xml(stream, document);
    } catch (const tree::xml_parser_error& error) {
        refuse(source.path, static_cast<int>(error.line()),
               fmt::format("not readable as XML ({})", error.message()));
    }
    const auto storage = document.find("opencv_storage");
    if (storage == document.not_found())
        refuse(source.path, 0, "not OpenCV XML, expected an element opencv_storage");
    return converted(storage->second);
}

YAML::Node from_yaml(const SourceText& source) {
    try {
        // OpenCV's first line, "%YAML:1.0", passes as a directive that nobody knows.
        return YAML::Load(source.text);
    } catch (const YAML::Exception& error) {
        refuse(source.path, error.mark.line + 1, fmt::format("not readable as YAML ({})", error.msg));
    }
}

// `budget`: nodes that may still be visited, since aliases can make a small file large.
void append_numbers(const YAML::Node& node, int depth, int& budget, const YamlField& field,
                    std::vector<double>& out) {
    if (--budget < 0) field.refuse(fmt::format("has more than {} elements", kMostNumbers));
    if (node.IsSequence() && depth < kDeepest) {
        for (const YAML::Node& item : node)
            append_numbers(item, depth + 1, budget, field, out);
        return;
    }
    const std::string word = node.IsScalar() ? node.Scalar() : std::string();
    const std::optional<double> value = parse_number(word);
    if (!value) field.refuse(fmt::format("\"{}\" is not a finite number", word.substr(0, 40)));
    out.push_back(*value);
}

std::vector<double> all_numbers(const YAML::Node& node, const YamlField& field) {
    std::vector<double> values;
    int budget = kMostNumbers;
    append_numbers(node, 0, budget, field, values);
    return values;
}

}  // namespace

YamlField::YamlField(const SourceText& source) : path_(source.path) {
    const std::size_t first = source.text.find_first_not_of(" \t\r\n");
    node_ = source.text[first] == '<' ? from_xml(source) : from_yaml(source);
}

std::vector<std::string> YamlField::keys() const {
    std::vector<std::string> names;
    if (!node_.IsMap()) return names;
    for (const auto& item : node_)
        if (item.first.IsScalar()) names.push_back(item.first.Scalar());
    return names;
}

YamlField YamlField::at(const std::string& key) const {
    std::optional<YamlField> field = find(key);
    if (!field) refuse(fmt::format("\"{}\" is missing", key));
    return *field;
}

std::optional<YamlField> YamlField::find(const std::string& key) const {
    if (!has(key)) return std::nullopt;
    return YamlField(path_, name_.empty() ? key : name_ + "." + key, node_[key]);
}

YamlField YamlField::item(std::size_t index) const {
    if (!node_.IsSequence() || node_.size() <= index)
        refuse(fmt::format("expected a list of at least {}", index + 1));
    return YamlField(path_, fmt::format("{}[{}]", name_, index), node_[index]);
}

std::string YamlField::text() const {
    if (!node_.IsScalar()) refuse("expected a word");
    return node_.Scalar();
}

double YamlField::number() const {
    if (!node_.IsScalar()) refuse("expected a number");
    return all_numbers(node_, *this).front();
}

int YamlField::whole_number() const {
    const double value = number();
    if (value != std::floor(value) || std::abs(value) > 1e6)
        refuse(fmt::format("{} is not a small whole number", value));
    return static_cast<int>(value);
}

std::vector<double> YamlField::numbers() const {
    if (!node_.IsSequence()) refuse("expected a list of numbers");
    return all_numbers(node_, *this);
}

std::vector<double> YamlField::numbers(std::size_t count) const {
    std::vector<double> values = numbers();
    if (values.size() != count) refuse(fmt::format("has {} numbers, expected {}", values.size(), count));
    return values;
}

std::vector<double> YamlField::shaped(int& rows, int& columns) const {
    if (node_.IsMap()) {
        rows = at("rows").whole_number();
        columns = at("cols").whole_number();
        std::vector<double> values = at("data").numbers();
        if (rows < 0 || columns < 0 ||
            static_cast<double>(values.size()) != static_cast<double>(rows) * columns)
            refuse(fmt::format("says {} x {}, but its data has {} numbers", rows, columns, values.size()));
        return values;
    }
    std::vector<double> values = numbers();
    const bool nested = node_.size() > 0 && node_[0].IsSequence();
    rows = nested ? static_cast<int>(node_.size()) : 1;
    columns = static_cast<int>(values.size()) / rows;
    if (nested)
        for (const YAML::Node& row : node_)
            if (!row.IsSequence() || row.size() != static_cast<std::size_t>(columns))
                refuse("its rows have different lengths");
    return values;
}

std::vector<double> YamlField::matrix(int rows, int columns) const {
    int found_rows = 0;
    int found_columns = 0;
    std::vector<double> values = shaped(found_rows, found_columns);
    const bool is_vector = rows == 1 || columns == 1;
    const bool flat_list = node_.IsSequence() && found_rows == 1;
    const bool fits = (found_rows == rows && found_columns == columns) ||
                      (is_vector && found_rows == columns && found_columns == rows) ||
                      (flat_list && static_cast<int>(values.size()) == rows * columns);
    if (!fits) refuse(fmt::format("is {} x {}, expected {} x {}", found_rows, found_columns, rows, columns));
    return values;
}

std::vector<double> YamlField::vector() const {
    int rows = 0;
    int columns = 0;
    std::vector<double> values = shaped(rows, columns);
    if (rows > 1 && columns > 1) refuse(fmt::format("is {} x {}, expected one row or column", rows, columns));
    return values;
}

void YamlField::refuse(const std::string& what) const {
    const int line = node_.IsDefined() ? node_.Mark().line + 1 : 0;
    io::refuse(path_, name_.empty() ? 0 : line, name_.empty() ? what : fmt::format("{}: {}", name_, what));
}

}  // namespace groundline::io
