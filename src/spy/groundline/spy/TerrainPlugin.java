package groundline.spy;

import groundline.ground_t;
import groundline.image_t;
import groundline.mask_t;
import groundline.sectors_t;
import groundline.vdisparity_t;
import java.awt.event.ActionEvent;
import java.io.IOException;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import javax.swing.JFrame;
import javax.swing.JInternalFrame;
import javax.swing.SwingUtilities;
import javax.swing.Timer;
import lcm.lcm.LCM;
import lcm.lcm.LCMSubscriber;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;

/** Offers the terrain view for groundline's channels in lcm-spy, and as a program of its own: main [PREFIX]. */
public class TerrainPlugin implements SpyPlugin {
    @Override
    public boolean canHandle(long fingerprint) {
        return fingerprint == mask_t.LCM_FINGERPRINT || fingerprint == sectors_t.LCM_FINGERPRINT
                || fingerprint == ground_t.LCM_FINGERPRINT || fingerprint == vdisparity_t.LCM_FINGERPRINT
                || fingerprint == image_t.LCM_FINGERPRINT;
    }

    @Override
    public Action getAction(JDesktopPane desktop, ChannelData channel) {
        return new AbstractAction("groundline: mask, v-disparity, sectors") {
            @Override
            public void actionPerformed(ActionEvent event) {
                String prefix = channel.name.replaceFirst("_[^_]*$", "");
                JInternalFrame frame = new JInternalFrame(prefix, true, true, true, true);
                frame.add(open(prefix));
                frame.pack();
                frame.setVisible(true);
                desktop.add(frame);
                JFrame window = (JFrame) SwingUtilities.getWindowAncestor(desktop);
                window.setSize(frame.getWidth() + 30, frame.getHeight() + 60);
            }
        };
    }

    /** A view that listens to the channels of that prefix as long as it is shown. */
    private static TerrainView open(String prefix) {
        TerrainView view = new TerrainView();
        LCMSubscriber subscriber = (lcm, channel, in) -> {
            try {
                view.take(channel, in);
            } catch (IOException | RuntimeException damaged) { // what else escapes ends LCM's thread
                System.err.println(channel + ": a message that cannot be decoded: " + damaged);
            }
        };
        String channels = java.util.regex.Pattern.quote(prefix) + "_(MASK|SECTORS|GROUND|VDISPARITY|PREVIEW)";
        LCM.getSingleton().subscribe(channels, subscriber);
        Timer look = new Timer(200, tick -> view.repaint()); // so that silence shows
        look.start();
        view.addHierarchyListener(change -> {
            boolean gone = (change.getChangeFlags() & java.awt.event.HierarchyEvent.DISPLAYABILITY_CHANGED) != 0
                    && !view.isDisplayable();
            if (gone) {
                look.stop();
                LCM.getSingleton().unsubscribe(channels, subscriber);
            }
        });
        return view;
    }

    public static void main(String[] words) {
        String prefix = words.length > 0 ? words[0] : "GROUNDLINE";
        SwingUtilities.invokeLater(() -> {
            JFrame window = new JFrame("groundline: " + prefix);
            window.add(open(prefix));
            window.pack();
            window.setDefaultCloseOperation(JFrame.EXIT_ON_CLOSE);
            window.setVisible(true);
        });
    }
}
