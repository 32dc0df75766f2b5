// The program `groundlined`: sets everything up, runs the pipeline, and watches over it until it is told to
// end.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.hpp"

namespace groundline::daemon {

inline constexpr const char* kDefaultConfig = "/etc/groundline/groundline.yaml";

struct DaemonOptions {
    std::filesystem::path config = kDefaultConfig;
    bool config_named = false;  // on the command line: then the file must be there
    std::vector<std::string> set;
    bool check_only = false;
};

// Before anything else and from the main thread. Until the pipeline is set up SIGTERM and SIGINT end the
// program at once with status 0, also where a file or a device does not answer; SIGHUP waits.
void prepare_signals();

// The multicast group that the configured LCM messages stay on this computer with, empty where they leave it
// or need none. Throws Refusal as run_daemon() does for a configuration.
std::string configured_loopback_group(const DaemonOptions& options);

// Returns when a recording ended, a thread failed, or SIGTERM or SIGINT came; after such a signal the program
// ends within a second whatever hangs, if need be from inside here with status 0. Throws Refusal for what can
// be told before the first frame.
ExitStatus run_daemon(const DaemonOptions& options);

}  // namespace groundline::daemon
