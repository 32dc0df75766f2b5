"""No multicast route at the start: the daemon runs all the same, and is heard once there is one."""
import robot


def case(stack):
    robot.expect("224.0.0.0" not in robot.command("ip", "route"), "there is a multicast route already")
    daemon = robot.Daemon(stack, capture_driver="synthetic", capture_source="drive?width=320&height=240&focal=250")
    robot.until(lambda: "LCM" in daemon.said() and "route" in daemon.said(), "the log's word that there is no route")
    robot.expect(daemon.running(), "the daemon ended")
    radio = robot.Radio(stack)  # adds the route
    health = radio.wait_running()
    robot.expect(robot.counters(health)["publish_failures"] > 0, f"no failure was counted: {robot.told(health)}")
    daemon.end()
    return robot.told(radio.now())


robot.run(case)
