// The program `groundlined`: the command line of the daemon.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <new>
#include <string>

#include "daemon/daemon.hpp"
#include "daemon/log.hpp"

namespace {

using groundline::ExitStatus;

constexpr int kError = 3;  // syslog's number

int fail(ExitStatus status, const std::string& sentence) {
    groundline::daemon::say(kError, sentence);
    return static_cast<int>(status);
}

int run(int argc, char** argv) {
    groundline::daemon::DaemonOptions options;
    CLI::App app{"Turns what two cameras see into obstacle masks over LCM, until it is told to end."};
    app.name("groundlined");
    app.set_version_flag("--version", GROUNDLINE_VERSION);
    const CLI::Option* config =
        app.add_option("--config", options.config, "Configuration file")->capture_default_str();
    app.add_option("--set", options.set, "One key=value over the file; may be given again")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    app.add_flag("--check-config", options.check_only,
                 "Set everything up as a start would, say whether it is good, and end");
    bool print_group = false;
    app.add_flag("--print-loopback-group", print_group,
                 "Print the multicast group of LCM messages that stay on this computer (ttl=0), or nothing, "
                 "and end");
    app.footer(
        "SIGTERM ends it within a second, SIGHUP reads the configuration again; keys marked (reload) in\n"
        "`groundline config` are taken over. Exit status: 0 told to end, or the recording ended; 1 failed;\n"
        "2 misuse; 66 input missing or unreadable; 78 configuration or calibration refused.");
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& help) {
        return app.exit(help);
    } catch (const CLI::ParseError& misuse) {
        return fail(ExitStatus::kUsage, fmt::format("{}; see groundlined --help", misuse.what()));
    }
    options.config_named = config->count() > 0;
    if (print_group) {
        fmt::print("{}\n", groundline::daemon::configured_loopback_group(options));
        return static_cast<int>(ExitStatus::kDone);
    }
    return static_cast<int>(groundline::daemon::run_daemon(options));
}

}  // namespace

int main(int argc, char** argv) {
    groundline::daemon::prepare_signals();
    try {
        return run(argc, argv);
    } catch (const groundline::Refusal& refusal) {
        return fail(refusal.status(), refusal.what());
    } catch (const std::bad_alloc&) {
        return fail(ExitStatus::kFailed, "not enough memory for pictures of this size");
    } catch (const std::exception& failure) {
        return fail(ExitStatus::kFailed, failure.what());
    }
}
