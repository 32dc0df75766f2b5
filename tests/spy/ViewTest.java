package groundline.spy;

import groundline.ground_t;
import groundline.mask_t;
import groundline.sectors_t;
import groundline.vdisparity_t;
import java.awt.Dimension;
import java.awt.Graphics2D;
import java.awt.image.BufferedImage;
import java.io.EOFException;
import java.io.File;
import javax.imageio.ImageIO;
import lcm.lcm.LCMDataInputStream;
import lcm.lcm.LCMDataOutputStream;
import lcm.logging.Log;

/** LOG PNG: the masks of a log have the shares of classes that the ground messages say, and the view draws them. */
public final class ViewTest {
    private static void check(boolean holds, String what) {
        if (!holds)
            throw new AssertionError(what);
    }

    private static byte[] encoded(sectors_t message) throws Exception {
        LCMDataOutputStream out = new LCMDataOutputStream();
        message.encode(out);
        return out.toByteArray();
    }

    private static BufferedImage painted(TerrainView view) {
        BufferedImage image = new BufferedImage(view.getWidth(), view.getHeight(), BufferedImage.TYPE_INT_RGB);
        Graphics2D out = image.createGraphics();
        view.paint(out);
        out.dispose();
        return image;
    }

    /** Pixels of a part of the picture, in sixths of its width, in which one colour is that much above the others. */
    private static int coloured(BufferedImage image, int from, int to, int shift, int above) {
        int count = 0;
        for (int y = 30; y < image.getHeight(); ++y) {
            for (int x = from * image.getWidth() / 6; x < to * image.getWidth() / 6; ++x) {
                int rgb = image.getRGB(x, y);
                int it = rgb >> shift & 255;
                int others = 0;
                for (int other = 0; other <= 16; other += 8)
                    if (other != shift)
                        others = Math.max(others, rgb >> other & 255);
                count += it > others + above ? 1 : 0;
            }
        }
        return count;
    }

    public static void main(String[] words) throws Exception {
        TerrainView view = new TerrainView();
        view.setSize(new Dimension(1080, 620));
        BufferedImage empty = painted(view);
        check(coloured(empty, 0, 6, 16, 40) == 0 && coloured(empty, 0, 6, 8, 40) == 0, "colours before any message");

        mask_t mask = null;
        vdisparity_t vDisparity = null;
        sectors_t sectors = null;
        int grounds = 0;
        Log log = new Log(words[0], "r");
        try {
            for (;;) {
                Log.Event event = log.readNext();
                view.take(event.channel, new LCMDataInputStream(event.data));
                if (event.channel.endsWith("_MASK"))
                    mask = new mask_t(event.data);
                if (event.channel.endsWith("_SECTORS"))
                    sectors = new sectors_t(event.data);
                if (event.channel.endsWith("_VDISPARITY"))
                    vDisparity = new vdisparity_t(event.data);
                if (event.channel.endsWith("_GROUND")) {
                    ground_t ground = new ground_t(event.data);
                    check(mask.utime == ground.utime, "the mask comes first");
                    byte[] classes = MaskDecoder.decode(mask);
                    check(classes != null, "the mask can be decoded");
                    int[] count = new int[4];
                    for (byte each : classes)
                        ++count[each];
                    for (int kind = 0; kind < 4; ++kind)
                        check(Math.abs((double) count[kind] / classes.length - ground.class_share[kind]) < 1e-9,
                                "class " + kind + ": " + count[kind]);
                    ++grounds;
                }
            }
        } catch (EOFException end) {
            check(grounds == 3, "three frames: " + grounds);
        }
        BufferedImage image = painted(view);
        ImageIO.write(image, "png", new File(words[1]));
        check(coloured(image, 0, 4, 16, 40) > 1000, "obstacles are red");
        check(coloured(image, 0, 4, 8, 10) > 20000, "ground is green");
        for (int v = 260; v < 480; v += 20) {
            double x = 726 + (vDisparity.line_slope * v + vDisparity.line_offset_px - vDisparity.first_px + 0.5) * 348
                    / vDisparity.bins;
            double y = 34 + (v + 0.5) / vDisparity.row_scale * 284 / vDisparity.rows;
            int reddest = 0;
            for (int i = -2; i <= 2; ++i) {
                int rgb = image.getRGB((int) x + i, (int) y);
                reddest = Math.max(reddest, (rgb >> 16 & 255) - (rgb >> 8 & 255));
            }
            check(reddest > 100, "the ground line is red at row " + v);
        }
        check(coloured(image, 4, 6, 8, 40) > 500, "free sectors are green");

        mask_t large = new mask_t();
        large.width = large.height = large.scale = 8192;
        large.encoding = mask_t.ENCODING_GRID;
        large.size = 2;
        large.data = new byte[2];
        check(MaskDecoder.decode(large) == null, "one cell in two bytes");
        large.width = 8193;
        check(MaskDecoder.decode(large) == null, "more than 2^26 pixels");
        byte[] whole = mask.data;
        for (int size = 0; size < whole.length; ++size) {
            mask.size = size;
            check(MaskDecoder.decode(mask) == null, "a mask cut off at " + size);
        }
        Thread.sleep((long) (1000 * TerrainView.STALE_S) + 100);
        // Later sectors come through, masks do not.
        view.take("GROUNDLINE_SECTORS", new LCMDataInputStream(encoded(sectors)));
        BufferedImage without = painted(view);
        check(coloured(without, 0, 4, 16, 40) == 0, "an old mask is shown beside new sectors");
        check(coloured(without, 4, 6, 8, 40) > 500, "new sectors are shown without a mask");
        Thread.sleep((long) (1000 * TerrainView.STALE_S) + 100);
        BufferedImage stale = painted(view);
        check(coloured(stale, 0, 6, 16, 40) == 0 && coloured(stale, 0, 6, 8, 40) == 0, "an old mask is shown");
    }
}
