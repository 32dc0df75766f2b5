// SPDX-License-Identifier: MIT OR GPL-2.0
/* A second vimc camera. The driver registers one device of its own and serves any other of its name. */
#include <linux/module.h>
#include <linux/platform_device.h>

static struct platform_device *twin;

static int __init twin_init(void)
{
	twin = platform_device_register_simple("vimc", 1, NULL, 0);
	return PTR_ERR_OR_ZERO(twin);
}

static void __exit twin_exit(void)
{
	platform_device_unregister(twin);
}

module_init(twin_init);
module_exit(twin_exit);
MODULE_DESCRIPTION("A second virtual media controller camera");
MODULE_LICENSE("Dual MIT/GPL");
