# Makes groundline.yaml(5) from config/groundline.yaml, which is itself made from the table of keys.
function plain(text) {
    gsub(/\\/, "\\e", text)
    gsub(/-/, "\\-", text)
    if (text ~ /^[.']/) text = "\\&" text
    return text
}
BEGIN {
    print ".TH GROUNDLINE.YAML 5 \"\" groundline"
    print ".SH NAME\ngroundline.yaml \\- configuration of groundline and groundlined"
    print ".SH SYNOPSIS\n.I /etc/groundline/groundline.yaml"
    print ".SH DESCRIPTION"
    print "YAML: one key a line, dotted (\\fBstereo.matcher: paper\\fR) or nested. A key that is left out has its default."
    print "An unknown key or a value out of range is an error that names its line. A running"
    print ".BR groundlined (8)"
    print "takes over keys marked (reload) on SIGHUP; the others need a restart."
    print ".B groundline config"
    print "prints a file with every key at its default.\n.SH KEYS"
}
NR <= 2 || /^$/ { next }
/^# / { help = substr($0, 3); next }
/^#/ {
    at = index($0, ":")
    value = substr($0, at + 2)
    print ".TP\n.BR " plain(substr($0, 2, at - 2)) " \" (" (value == "" ? "empty" : plain(value)) ")\""
    print plain(help)
}
END {
    print ".SH SEE ALSO\n.BR groundline (1),\n.BR groundlined (8)"
}
