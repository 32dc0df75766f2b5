package groundline.spy;

import groundline.ground_t;
import groundline.image_t;
import groundline.mask_t;
import groundline.sector_t;
import groundline.sectors_t;
import groundline.vdisparity_t;
import java.awt.BasicStroke;
import java.awt.Color;
import java.awt.Dimension;
import java.awt.Font;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.Rectangle;
import java.awt.RenderingHints;
import java.awt.geom.Arc2D;
import java.awt.geom.Line2D;
import java.awt.geom.Path2D;
import java.awt.image.BufferedImage;
import java.io.IOException;
import java.util.Arrays;
import javax.swing.JPanel;
import lcm.lcm.LCMDataInputStream;

/**
 * What groundline sees, in one picture: the mask over the preview, the v-disparity image with the ground line and its
 * tolerance, the sectors from above. Without news for STALE_S it says so and shows nothing: an old mask is no mask.
 */
public final class TerrainView extends JPanel {
    static final double STALE_S = 0.5;

    // By class id: unknown, traversable, obstacle, drop; alpha over the preview.
    private static final int[] TINT = {0x90000000, 0x3000c040, 0x90ff3020, 0x90e000ff};
    private static final Color BACK = new Color(24, 24, 28);
    private static final Color FREE = new Color(0, 150, 60);
    private static final Color BLOCKED = new Color(255, 70, 50);
    private static final Color DROP = new Color(224, 0, 255);
    private static final Color TOLERANCE = new Color(255, 150, 190);
    private static final Color TEXT = new Color(220, 220, 220);
    private static final double SHOWN_M = 10;

    private mask_t mask;
    private BufferedImage overlay;
    private image_t preview;
    private ground_t ground;
    private vdisparity_t vDisparity;
    private sectors_t sectors;
    private long newsNs;
    private long maskNs;
    private long vDisparityNs;
    private boolean badMask;

    public TerrainView() {
        setPreferredSize(new Dimension(1080, 620));
        setBackground(BACK);
    }

    /** Takes in one message; the end of the channel's name says which. Any thread. */
    public synchronized void take(String channel, LCMDataInputStream in) throws IOException {
        if (channel.endsWith("_MASK")) {
            mask = new mask_t(in);
            byte[] classes = MaskDecoder.decode(mask);
            badMask = classes == null;
            overlay = badMask ? null : tinted(classes, mask.width, mask.height);
            maskNs = System.nanoTime();
        } else if (channel.endsWith("_PREVIEW")) {
            preview = new image_t(in);
        } else if (channel.endsWith("_GROUND")) {
            ground = new ground_t(in);
        } else if (channel.endsWith("_VDISPARITY")) {
            vDisparity = new vdisparity_t(in);
            vDisparityNs = System.nanoTime();
        } else if (channel.endsWith("_SECTORS")) {
            sectors = new sectors_t(in);
        } else {
            return;
        }
        newsNs = System.nanoTime();
        repaint();
    }

    private static BufferedImage tinted(byte[] classes, int width, int height) {
        BufferedImage image = new BufferedImage(width, height, BufferedImage.TYPE_INT_ARGB);
        int[] pixels = new int[classes.length];
        Arrays.setAll(pixels, i -> TINT[classes[i]]);
        image.setRGB(0, 0, width, height, pixels, 0, width);
        return image;
    }

    @Override
    protected synchronized void paintComponent(Graphics graphics) {
        super.paintComponent(graphics);
        Graphics2D out = (Graphics2D) graphics;
        out.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
        out.setFont(getFont().deriveFont(Font.PLAIN, 14f));
        out.setColor(TEXT);
        if (!fresh(newsNs)) {
            String since = newsNs == 0 ? "nothing yet"
                    : String.format("nothing for %.0f s", 1e-9 * (System.nanoTime() - newsNs));
            out.drawString(since + ": does groundlined run, and is its LCM URL ours?", 20, 30);
            return;
        }
        int line = 28;
        int right = 2 * getWidth() / 3;
        int half = (getHeight() + line) / 2;
        out.drawString(headline(), 12, 19);
        if (!withoutPairs()) {
            drawMask(out, inside(0, line, right, getHeight() - line));
            drawVDisparity(out, inside(right, line, getWidth() - right, half - line));
        }
        drawSectors(out, inside(right, half, getWidth() - right, getHeight() - half));
    }

    /** The newest sectors say that no pairs come; what else was said is of pairs before. */
    private boolean withoutPairs() {
        return sectors != null && sectors.sequence < 0;
    }

    private static boolean fresh(long ns) {
        return ns != 0 && 1e-9 * (System.nanoTime() - ns) <= STALE_S;
    }

    private static Rectangle inside(int x, int y, int width, int height) {
        return new Rectangle(x + 6, y + 6, Math.max(1, width - 12), Math.max(1, height - 12));
    }

    private String headline() {
        if (withoutPairs())
            return Reasons.words(sectors.verdict, sectors.reasons);
        if (!fresh(maskNs)) // the largest message is lost first
            return (sectors == null ? "" : "pair " + sectors.sequence + "   " + Reasons.words(sectors.verdict, sectors.reasons))
                    + "   no mask comes through: are the receive buffers large enough (net.core.rmem_default)?";
        String pose = ground == null || Double.isNaN(ground.height_m) ? ""
                : String.format("   pitch %.1f°, roll %.1f°, height %.2f m", Math.toDegrees(ground.pitch_rad),
                        Math.toDegrees(ground.roll_rad), ground.height_m);
        return "pair " + mask.sequence + "   " + Reasons.words(mask.verdict, mask.reasons) + pose
                + (badMask ? "   THE MASK CANNOT BE DECODED" : "");
    }

    private void drawMask(Graphics2D out, Rectangle area) {
        if (!fresh(maskNs) || overlay == null)
            return;
        double zoom = Math.min((double) area.width / mask.width, (double) area.height / mask.height);
        int width = (int) (zoom * mask.width);
        int height = (int) (zoom * mask.height);
        BufferedImage picture = preview != null && preview.utime == mask.utime ? image(preview) : null;
        if (picture != null) {
            out.drawImage(picture, area.x, area.y, width, height, null);
        } else {
            out.setColor(Color.GRAY);
            out.fillRect(area.x, area.y, width, height);
        }
        out.drawImage(overlay, area.x, area.y, width, height, null);
    }

    private static BufferedImage image(image_t from) {
        if (from.pixelformat != image_t.PIXEL_FORMAT_RGB || from.width <= 0 || from.height <= 0
                || 3L * from.width > from.row_stride || from.size < (long) from.height * from.row_stride)
            return null;
        BufferedImage image = new BufferedImage(from.width, from.height, BufferedImage.TYPE_INT_RGB);
        for (int y = 0; y < from.height; ++y) {
            for (int x = 0; x < from.width; ++x) {
                int at = y * from.row_stride + 3 * x;
                image.setRGB(x, y,
                        (from.data[at] & 255) << 16 | (from.data[at + 1] & 255) << 8 | from.data[at + 2] & 255);
            }
        }
        return image;
    }

    private void drawVDisparity(Graphics2D out, Rectangle area) {
        out.setColor(TEXT);
        if (!fresh(vDisparityNs) || vDisparity.rows <= 0 || vDisparity.bins <= 0) {
            out.drawString("no v-disparity: is publish.v_disparity on?", area.x, area.y + 14);
            return;
        }
        if (vDisparity.size != (long) vDisparity.bins * vDisparity.rows)
            return;
        BufferedImage image = new BufferedImage(vDisparity.bins, vDisparity.rows, BufferedImage.TYPE_INT_RGB);
        for (int i = 0; i < vDisparity.size; ++i) {
            int grey = (int) Math.round(255 * Math.sqrt((vDisparity.data[i] & 255) / 255.0)); // few pixels show too
            image.setRGB(i % vDisparity.bins, i / vDisparity.bins, grey << 16 | grey << 8 | grey);
        }
        out.drawImage(image, area.x, area.y, area.width, area.height, null);
        if (Double.isNaN(vDisparity.line_slope) || mask == null)
            return;
        java.awt.Shape clip = out.getClip();
        out.clip(area);
        double ratio = Double.isNaN(mask.tolerance_ratio) ? mask.tolerance_m / (ground == null ? Double.NaN : ground.height_m)
                : mask.tolerance_ratio;
        out.setStroke(new BasicStroke(1.2f));
        out.setColor(TOLERANCE);
        if (ratio > 0 && ratio < 1) {
            drawLine(out, area, 1 / (1 - ratio));
            drawLine(out, area, 1 / (1 + ratio));
        }
        out.setColor(Color.RED);
        drawLine(out, area, 1);
        out.setClip(clip);
    }

    /** Where a height above the ground of (1 - 1 / factor) camera heights lies: d = factor * d_ground. */
    private void drawLine(Graphics2D out, Rectangle area, double factor) {
        double offset = Double.isNaN(mask.disparity_offset_px) ? 0 : mask.disparity_offset_px;
        Path2D path = new Path2D.Double();
        for (int v = 0; v < vDisparity.image_height; ++v) {
            double truth = vDisparity.line_slope * v + vDisparity.line_offset_px - offset;
            if (truth < 0)
                continue;
            double bin = factor * truth + offset - vDisparity.first_px + 0.5;
            double x = area.x + bin * area.width / vDisparity.bins;
            double y = area.y + (v + 0.5) / vDisparity.row_scale * area.height / vDisparity.rows;
            if (path.getCurrentPoint() == null)
                path.moveTo(x, y);
            else
                path.lineTo(x, y);
        }
        out.draw(path);
    }

    private void drawSectors(Graphics2D out, Rectangle area) {
        double perMetre = Math.min(area.height - 20, area.width / 2.0) / SHOWN_M;
        double x = area.x + area.width / 2.0;
        double y = area.y + area.height;
        if (sectors != null) {
            for (sector_t sector : sectors.sectors) {
                out.setColor(FREE);
                out.fill(wedge(x, y, sector, perMetre * Math.min(sector.free_range_m, SHOWN_M), Arc2D.PIE));
                if (sector.blocked && sector.nearest_m <= SHOWN_M) {
                    out.setColor(sector.kind == mask_t.CLASS_DROP ? DROP
                            : sector.kind == mask_t.CLASS_OBSTACLE ? BLOCKED : Color.ORANGE);
                    out.setStroke(new BasicStroke(sector.held ? 2f : 5f));
                    out.draw(wedge(x, y, sector, perMetre * sector.nearest_m, Arc2D.OPEN));
                }
            }
        }
        out.setStroke(new BasicStroke(1f));
        for (int metres = 2; metres <= SHOWN_M; metres += 2) {
            out.setColor(Color.DARK_GRAY);
            double radius = perMetre * metres;
            out.draw(new Arc2D.Double(x - radius, y - radius, 2 * radius, 2 * radius, 0, 180, Arc2D.OPEN));
            out.setColor(TEXT);
            out.drawString(metres + " m", (float) x + 3, (float) (y - radius + 12));
        }
        out.setColor(TEXT);
        out.draw(new Line2D.Double(x - 6, y - 1, x + 6, y - 1));
    }

    private static Arc2D wedge(double x, double y, sector_t sector, double radius, int kind) {
        double from = 90 + Math.toDegrees(sector.bearing_rad - 0.5 * sector.width_rad);
        return new Arc2D.Double(x - radius, y - radius, 2 * radius, 2 * radius, from, Math.toDegrees(sector.width_rad), kind);
    }
}
