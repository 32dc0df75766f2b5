package groundline.spy;

import groundline.mask_t;

/** The class ids of a mask_t, one a pixel, as mask_t.lcm specifies its two encodings. */
final class MaskDecoder {
    private MaskDecoder() {}

    /** width * height ids, row-major; null where the data is not a mask of that size. */
    static byte[] decode(mask_t mask) {
        if (mask.width <= 0 || mask.height <= 0 || mask.scale <= 0 || (long) mask.width * mask.height > 1 << 26)
            return null;
        if (mask.encoding == mask_t.ENCODING_GRID && !sizedForGrid(mask))
            return null;
        byte[] classes = new byte[mask.width * mask.height];
        boolean good = mask.encoding == mask_t.ENCODING_RUNS && mask.scale == 1 ? runs(mask, classes)
                : mask.encoding == mask_t.ENCODING_GRID && grid(mask, classes);
        return good ? classes : null;
    }

    private static boolean runs(mask_t mask, byte[] classes) {
        int at = 0;
        int pixel = 0;
        while (at < mask.size) {
            long number = 0;
            int shift = 0;
            byte next;
            do {
                if (at == mask.size || shift > 28)
                    return false;
                next = mask.data[at++];
                number |= (long) (next & 0x7f) << shift;
                shift += 7;
            } while (next < 0);
            long length = (number >> 2) + 1;
            if (length > classes.length - pixel)
                return false;
            java.util.Arrays.fill(classes, pixel, pixel + (int) length, (byte) (number & 3));
            pixel += (int) length;
        }
        return pixel == classes.length;
    }

    private static int cells(int length, int scale) {
        return (length - 1) / scale + 1;
    }

    private static boolean sizedForGrid(mask_t mask) {
        return mask.size == (cells(mask.width, mask.scale) * cells(mask.height, mask.scale) + 3) / 4;
    }

    private static boolean grid(mask_t mask, byte[] classes) {
        int columns = cells(mask.width, mask.scale);
        for (int y = 0; y < mask.height; ++y) {
            for (int x = 0; x < mask.width; ++x) {
                int cell = y / mask.scale * columns + x / mask.scale;
                classes[y * mask.width + x] = (byte) (mask.data[cell / 4] >> 2 * (cell % 4) & 3);
            }
        }
        return true;
    }
}
