#include "capture/open.hpp"

#include <string_view>
#include <utility>

#include "capture/files.hpp"
#include "capture/synthetic.hpp"
#include "core/error.hpp"

namespace groundline::capture {
namespace {

constexpr std::string_view kSynthetic = "synthetic:";

}  // namespace

OpenedSource open_source(const std::vector<std::string>& words) {
    OpenedSource opened;
    if (!words.empty() && words[0].starts_with(kSynthetic)) {
        if (words.size() > 1)
            throw Refusal(ExitStatus::kUsage, "'" + words[1] + "' follows '" + words[0] +
                                                  "', which is a whole source; give one of the two");
        auto source = std::make_unique<SyntheticSource>(words[0]);
        opened.rig = source->rig();
        opened.source = std::move(source);
        return opened;
    }
    io::OpenedPairs pairs = io::open_pairs(words);
    opened.note = pairs.reader->note();
    opened.folder = std::move(pairs.folder);
    opened.colour_pair = pairs.colour_pair;
    opened.source = files_source(std::move(pairs.reader));
    return opened;
}

}  // namespace groundline::capture
