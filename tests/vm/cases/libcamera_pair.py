"""Two vimc cameras through libcamera, in one process: pairs come, are processed and published.

They run free, each as fast as the machine can, and take no rate: it is set so low that half its period allows what
they are apart. libcamera's threads are ordinary ones, though it is the capture thread that starts them.
"""
import robot

OTHERS_OF_OURS = ("groundlined", "gl-log", "gl-health", "gl-process", "gl-worker1", "gl-sinks")


def case(stack):
    robot.need_driver("libcamera")
    robot.command("modprobe", "vimc")
    robot.command("modprobe", "vimc_twin")
    robot.command("udevadm", "settle")
    radio = robot.Radio(stack)
    settings = robot.camera_settings("platform/vimc.0 Sensor B", "platform/vimc.1 Sensor B", capture_driver="libcamera",
                                     capture_width=318,  # vimc scales to multiples of 6
                                     capture_pair__tolerance__ms=1000, capture_rate__hz=0.4,
                                     capture_stall__timeout__s=10)
    daemon = robot.Daemon(stack, **settings, realtime_capture__cpus=1)
    radio.wait_running(pairs=15)  # more than there are buffers
    health = radio.wait(lambda h: True, "health")
    counted = robot.counters(health)
    robot.expect(counted["frames_bad"] == 0 and counted["camera_restarts"] == 0, robot.told(health))
    # libcamera may leave its threads the name of the one that started them.
    threads = [thread for thread in daemon.placed() if thread[0] not in OTHERS_OF_OURS]
    capture = ("gl-capture", "1", robot.FIFO)
    robot.expect(threads.count(capture) == 1, f"no thread is {capture}: {threads}")
    threads.remove(capture)
    robot.expect(threads and all(place == ["0-1", robot.ORDINARY] for _, *place in threads),
                 f"libcamera's threads are not ordinary ones on all processors: {threads}")
    daemon.end()
    return robot.told(radio.now())


robot.run(case)
