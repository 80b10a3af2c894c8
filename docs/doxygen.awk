# SPDX-License-Identifier: Apache-2.0
# Doxygen's view of a header: plain // comments become documentation comments. docs/Doxyfile runs it on every file.
#
# The first comment documents the file, and so does one of two lines or more that an empty line follows: the contract of
# a part of it. A comment directly above a declaration documents that declaration, one behind it the member before it. A
# line by itself stays a comment. Indented lines (equations, examples) keep their layout.
# The inline namespace of the instruction set is no business of a reader and is left out.

function escaped(text) {
  gsub(/\\/, "\\\\", text)
  gsub(/[@#%&<>*_|$\[\]]/, "\\\\&", text)
  gsub(/--/, "-\\-", text)
  gsub(/::/, "\\::", text)
  return text
}

# Writes the comment lines collected so far, as documentation or as they were.
function flush_comment(document,    i, text, code, list, starts) {
  for (i = 1; i <= count; ++i) {
    if (!document) {
      print original[i]
      continue
    }
    text = body[i]
    starts = 0  # a paragraph of its own
    if (text ~ /^ +([-*]|[0-9]+\.) /) {
      list = 1
    } else if (text !~ /^  /) {
      starts = list || text ~ /^ [A-Z][a-z]+( [a-z]+)?: /
      list = 0
    }
    if (text ~ /^   / && !list) {
      if (!code) print "/// \\code{.unparsed}"
      code = 1
      print "///" text
    } else {
      if (code) print "/// \\endcode"
      code = 0
      if (starts && i > 1) print "///"
      match(text, /^ +([-*] )?/)
      print "///" substr(text, 1, RLENGTH) escaped(substr(text, RLENGTH + 1))
    }
  }
  if (code) print "/// \\endcode"
  count = 0
}

NR == 1 { print "/// \\file"; file_comment = 1; next }
/^inline namespace NPSIM_ABI \{/ || /^\}  \/\/ namespace NPSIM_ABI/ { flush_comment(0); print ""; next }

/^[ \t]*\/\// {
  if (trailing && index($0, "//") == trailing) {  # goes on with the comment behind the line above
    text = substr($0, trailing + 2)
    print substr($0, 1, trailing - 1) "///<" escaped(text)
    next
  }
  trailing = 0
  ++count
  original[count] = $0
  text = $0
  sub(/^[ \t]*\/\//, "", text)
  body[count] = text
  next
}

/^[ \t]*$/ && count > 1 && !file_comment {
  print "/// \\file"
  flush_comment(1)
}

{
  flush_comment(file_comment || ($0 !~ /^[ \t]*$/ && $0 !~ /^[ \t]*[#}]/))
  file_comment = 0
  # Behind a member, an enumerator or a constant; never behind a brace or a directive.
  trailing = match($0, /([;,]|^ +[a-z_0-9]+( = [0-9a-zA-Z_]+)?) +\/\/ /) ? RSTART + RLENGTH - 3 : 0
  if (trailing && $0 !~ /^[ \t]*[#}]/ && $0 !~ /NOLINT/) {
    print substr($0, 1, trailing - 1) "///<" escaped(substr($0, trailing + 2))
  } else {
    trailing = 0
    print
  }
}

END { flush_comment(0) }
