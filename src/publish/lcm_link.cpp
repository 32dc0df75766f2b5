#include "publish/lcm_link.hpp"

#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/error.hpp"

namespace groundline::publish {
namespace {

constexpr std::string_view kDefaultUrl = "udpm://239.255.76.67:7667?ttl=0";
constexpr std::string_view kDefaultAddress = "239.255.76.67";
constexpr std::string_view kMulticast = "udpm";
constexpr std::array<std::string_view, 5> kProviders = {kMulticast, "mpudpm", "tcpq", "file", "memq"};

std::string_view provider_of(std::string_view url) {
    const std::size_t end = url.find("://");
    return end == std::string_view::npos ? std::string_view() : url.substr(0, end);
}

// The address part of udpm://ADDRESS:PORT?options; LCM's default where it is left out.
std::string multicast_address(std::string_view url) {
    std::string_view rest = url.substr(url.find("://") + 3);
    rest = rest.substr(0, rest.find_first_of(":?/"));
    return std::string(rest.empty() ? kDefaultAddress : rest);
}

// 0 if the kernel knows a way to `address`, else why not. Asked before LCM is, because LCM answers a missing
// route with ten lines on stderr at every attempt. Sends nothing: connecting a datagram socket only looks up
// the route.
int route_error(const std::string& address) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(7667);
    if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1) return EINVAL;
    const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (descriptor < 0) return errno;
    const int failed =
        ::connect(descriptor, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 ? 0 : errno;
    ::close(descriptor);
    return failed;
}

}  // namespace

std::string resolve_url(const std::string& argument) {
    if (!argument.empty()) return argument;
    const char* from_environment = std::getenv("LCM_DEFAULT_URL");
    if (from_environment != nullptr && *from_environment != '\0') return from_environment;
    return std::string(kDefaultUrl);
}

std::string loopback_group(const std::string& url) {
    if (provider_of(url) != kMulticast) return {};
    std::string_view options = url;
    options.remove_prefix(std::min(options.find('?'), options.size()));
    std::string_view ttl = "0";  // LCM's default
    while (!options.empty()) {
        options.remove_prefix(1);  // ? or &
        const std::string_view option = options.substr(0, options.find('&'));
        if (option.starts_with("ttl=")) ttl = option.substr(4);
        options.remove_prefix(option.size());
    }
    const std::string group = multicast_address(url);
    in_addr address{};
    const bool multicast =
        inet_pton(AF_INET, group.c_str(), &address) == 1 && IN_MULTICAST(ntohl(address.s_addr));
    return multicast && ttl == "0" ? group : std::string();
}

LcmLink::LcmLink(std::string url) : url_(std::move(url)) {
    if (std::ranges::find(kProviders, provider_of(url_)) == kProviders.end())
        throw Refusal(
            ExitStatus::kConfig,
            "LCM URL '" + url_ +
                "' is not understood: expected udpm://ADDRESS:PORT?ttl=0, file://PATH?mode=w or memq://");
}

LcmLink::~LcmLink() {
    close();
}

void LcmLink::close() {
    if (lcm_ != nullptr) lcm_destroy(lcm_);
    lcm_ = nullptr;
}

std::string LcmLink::why_not_open() const {
    const std::string_view provider = provider_of(url_);
    if (provider == kMulticast) {
        const std::string address = multicast_address(url_);
        const int failed = route_error(address);
        if (failed == EINVAL) return "'" + address + "' is not an IPv4 address";
        if (failed != 0)
            return "no route for multicast to " + address + " (" + std::generic_category().message(failed) +
                   "); as root: ip link set lo up && ip route add 224.0.0.0/4 dev lo";
    } else if (provider == "file") {
        return "the log file cannot be opened; check that its folder exists and may be written";
    }
    return "LCM refused it; check address, port and options";
}

bool LcmLink::open(std::int64_t now_mono_ns) {
    if (lcm_ != nullptr) return true;
    if (tried_ && now_mono_ns >= last_try_mono_ns_ && now_mono_ns - last_try_mono_ns_ < kRetryNs)
        return false;
    tried_ = true;
    last_try_mono_ns_ = now_mono_ns;
    const bool routed = provider_of(url_) != kMulticast || route_error(multicast_address(url_)) == 0;
    if (routed) lcm_ = lcm_create(url_.c_str());
    failing_ = false;
    if (lcm_ != nullptr) {
        error_.clear();
        return true;
    }
    ++open_failures_;
    error_ = "LCM cannot be opened at " + url_ + ": " + why_not_open() + "; trying again every second";
    return false;
}

bool LcmLink::send(const std::string& channel, std::span<const std::uint8_t> message,
                   std::int64_t now_mono_ns) {
    if (!open(now_mono_ns)) return false;
    if (lcm_publish(lcm_, channel.c_str(), message.data(), static_cast<unsigned>(message.size())) == 0) {
        if (failing_) error_.clear();
        failing_ = false;
        return true;
    }
    if (!failing_) {
        failing_ = true;
        failing_since_mono_ns_ = now_mono_ns;
        error_ =
            "LCM did not send a message on " + channel + " at " + url_ +
            "; if that lasts, check that the network is up and the multicast route is still there (ip route)";
    } else if (now_mono_ns - failing_since_mono_ns_ >= kRetryNs) {
        close();
    }
    return false;
}

}  // namespace groundline::publish
