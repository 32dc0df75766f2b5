// A value in a YAML, JSON or OpenCV XML file that knows where it stands, so that complaints can say so.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/calibration/source_text.hpp"

namespace groundline::io {

// All reading functions throw Refusal(kConfig) with file, line, name and what was expected.
class YamlField {  // NOLINT(bugprone-exception-escape): yaml-cpp does not declare its moves noexcept
  public:
    // The whole of a file: YAML, JSON, or XML as OpenCV writes it.
    explicit YamlField(const SourceText& source);

    bool is_map() const { return node_.IsMap(); }
    std::vector<std::string> keys() const;
    bool has(const std::string& key) const { return node_.IsMap() && node_[key].IsDefined(); }
    // Member of a map, which must be there.
    YamlField at(const std::string& key) const;
    std::optional<YamlField> find(const std::string& key) const;

    // Element of a list, which must be there.
    YamlField item(std::size_t index) const;

    std::string text() const;
    double number() const;
    int whole_number() const;
    // All numbers of a list, lists inside it flattened, row after row.
    std::vector<double> numbers() const;
    std::vector<double> numbers(std::size_t count) const;
    // A matrix written as {rows, cols, data} or as a list of numbers or of rows; a vector may stand upright
    // or lie.
    std::vector<double> matrix(int rows, int columns) const;
    // A vector of any length written in the same ways.
    std::vector<double> vector() const;

    [[noreturn]] void refuse(const std::string& what) const;

  private:
    YamlField(std::filesystem::path path, std::string name, const YAML::Node& node)
        : path_(std::move(path)), name_(std::move(name)), node_(node) {}
    std::vector<double> shaped(int& rows, int& columns) const;

    std::filesystem::path path_;
    std::string name_;  // empty for the whole file
    YAML::Node node_;
};

}  // namespace groundline::io
