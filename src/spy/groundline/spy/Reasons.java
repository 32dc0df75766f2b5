package groundline.spy;

import groundline.mask_t;
import java.lang.reflect.Field;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;

/** The verdict and its reasons in words. */
final class Reasons {
    private static final String[] VERDICTS = {"BLIND", "DEGRADED", "TRUSTED"};

    private Reasons() {}

    static String words(int verdict, int bits) {
        List<String> names = new ArrayList<>();
        for (Field field : mask_t.class.getFields()) {
            if (!field.getName().startsWith("REASON_"))
                continue;
            try {
                if ((bits & field.getInt(null)) != 0)
                    names.add(field.getName().substring("REASON_".length()).toLowerCase(Locale.ROOT).replace('_', ' '));
            } catch (IllegalAccessException impossible) {
                throw new AssertionError(impossible);
            }
        }
        String word = verdict >= 0 && verdict < VERDICTS.length ? VERDICTS[verdict] : "verdict " + verdict;
        return names.isEmpty() ? word : word + ": " + String.join(", ", names);
    }
}
