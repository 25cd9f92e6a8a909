// Zarith's primitives for the checker in a browser: an integer that fits 32 bits is a number, any other a BigInt.
// ml_z_normal is what keeps it so; every primitive returns through it.

//Provides: ml_z_normal
//Requires: ml_z_init
function ml_z_normal(x) { return x >= -2147483648 && x <= 2147483647 ? Number(x) : x; }

//Provides: ml_z_init
//Requires: caml_custom_ops, ml_z_compare
function ml_z_init() {
  BigInt.prototype.caml_custom = "_z";
  caml_custom_ops["_z"] = { compare: function (a, b) { return ml_z_compare(a, b); } };
  return 0;
}

//Provides: ml_z_fits_int
function ml_z_fits_int(x) { return typeof x === "number" ? 1 : 0; }

//Provides: ml_z_to_int
//Requires: caml_raise_constant, caml_named_value
function ml_z_to_int(x) {
  if (typeof x === "number") return x;
  caml_raise_constant(caml_named_value("ml_z_overflow"));
}

//Provides: ml_z_compare
function ml_z_compare(x, y) { return x < y ? -1 : x > y ? 1 : 0; }

//Provides: ml_z_equal
function ml_z_equal(x, y) { return x == y ? 1 : 0; }

//Provides: ml_z_sign
function ml_z_sign(x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }

//Provides: ml_z_neg
//Requires: ml_z_normal
function ml_z_neg(x) { return ml_z_normal(-BigInt(x)); }

//Provides: ml_z_abs
//Requires: ml_z_normal
function ml_z_abs(x) { return x < 0 ? ml_z_normal(-BigInt(x)) : x; }

//Provides: ml_z_succ
//Requires: ml_z_normal
function ml_z_succ(x) { return ml_z_normal(BigInt(x) + BigInt(1)); }

//Provides: ml_z_pred
//Requires: ml_z_normal
function ml_z_pred(x) { return ml_z_normal(BigInt(x) - BigInt(1)); }

//Provides: ml_z_add
//Requires: ml_z_normal
function ml_z_add(x, y) { return ml_z_normal(BigInt(x) + BigInt(y)); }

//Provides: ml_z_sub
//Requires: ml_z_normal
function ml_z_sub(x, y) { return ml_z_normal(BigInt(x) - BigInt(y)); }

//Provides: ml_z_mul_overflows
function ml_z_mul_overflows(x, y) { var z = x * y; return z >= -2147483648 && z <= 2147483647 ? 0 : 1; }

//Provides: ml_z_mul
//Requires: ml_z_normal
function ml_z_mul(x, y) { return ml_z_normal(BigInt(x) * BigInt(y)); }

//Provides: ml_z_divisor
//Requires: caml_raise_zero_divide
function ml_z_divisor(y) {
  if (y == 0) caml_raise_zero_divide();
  return BigInt(y);
}

//Provides: ml_z_div
//Requires: ml_z_normal, ml_z_divisor
function ml_z_div(x, y) { return ml_z_normal(BigInt(x) / ml_z_divisor(y)); }

//Provides: ml_z_rem
//Requires: ml_z_normal, ml_z_divisor
function ml_z_rem(x, y) { return ml_z_normal(BigInt(x) % ml_z_divisor(y)); }

//Provides: ml_z_div_rem
//Requires: ml_z_div, ml_z_rem
function ml_z_div_rem(x, y) { return [0, ml_z_div(x, y), ml_z_rem(x, y)]; }

//Provides: ml_z_divexact
//Requires: ml_z_div
function ml_z_divexact(x, y) { return ml_z_div(x, y); }

//Provides: ml_z_fdiv
//Requires: ml_z_normal, ml_z_divisor
function ml_z_fdiv(x, y) { // rounded down
  var a = BigInt(x), b = ml_z_divisor(y), q = a / b;
  return ml_z_normal(a % b != 0 && a < 0 !== b < 0 ? q - BigInt(1) : q);
}

//Provides: ml_z_cdiv
//Requires: ml_z_normal, ml_z_divisor
function ml_z_cdiv(x, y) { // rounded up
  var a = BigInt(x), b = ml_z_divisor(y), q = a / b;
  return ml_z_normal(a % b != 0 && a < 0 === b < 0 ? q + BigInt(1) : q);
}

//Provides: ml_z_gcd
//Requires: ml_z_normal
function ml_z_gcd(x, y) {
  var a = BigInt(x), b = BigInt(y);
  if (a < 0) a = -a;
  if (b < 0) b = -b;
  while (b != 0) { var r = a % b; a = b; b = r; }
  return ml_z_normal(a);
}

//Provides: ml_z_pow
//Requires: ml_z_normal, caml_invalid_argument
function ml_z_pow(x, n) {
  if (n < 0) caml_invalid_argument("Z.pow: exponent must be nonnegative");
  var square = BigInt(x), power = BigInt(1);
  for (; n > 0; n >>= 1) {
    if (n & 1) power *= square;
    if (n > 1) square *= square;
  }
  return ml_z_normal(power);
}

//Provides: ml_z_shift_left
//Requires: ml_z_normal, caml_invalid_argument
function ml_z_shift_left(x, n) {
  if (n < 0) caml_invalid_argument("Z.shift_left: count argument must be positive");
  return ml_z_normal(BigInt(x) << BigInt(n));
}

//Provides: ml_z_numbits
function ml_z_numbits(x) {
  if (x == 0) return 0;
  var hex = BigInt(x).toString(16).replace("-", ""); // the first digit has 1 to 4 bits
  return 4 * (hex.length - 1) + 32 - Math.clz32(parseInt(hex[0], 16));
}

//Provides: ml_z_sqrt
//Requires: ml_z_normal, ml_z_numbits, caml_invalid_argument
function ml_z_sqrt(x) { // Newton's steps from above fall until the root, rounded down, is found
  if (x < 0) caml_invalid_argument("Z.sqrt: square root of a negative number");
  if (x == 0) return 0;
  var n = BigInt(x), root = BigInt(1) << BigInt((ml_z_numbits(x) + 1) >> 1);
  for (;;) {
    var next = (root + n / root) >> BigInt(1);
    if (next >= root) return ml_z_normal(root);
    root = next;
  }
}

//Provides: ml_z_of_int64
//Requires: ml_z_normal, caml_int64_format, caml_jsbytes_of_string, caml_string_of_jsbytes
function ml_z_of_int64(x) { return ml_z_normal(BigInt(caml_jsbytes_of_string(caml_int64_format(caml_string_of_jsbytes("%d"), x)))); }

//Provides: ml_z_of_float
//Requires: ml_z_normal, caml_raise_constant, caml_named_value
function ml_z_of_float(x) {
  if (!isFinite(x)) caml_raise_constant(caml_named_value("ml_z_overflow"));
  return ml_z_normal(BigInt(Math.trunc(x)));
}

//Provides: ml_z_format
//Requires: caml_jsbytes_of_string, caml_string_of_jsbytes, caml_failwith
function ml_z_format(format, x) {
  if (caml_jsbytes_of_string(format) !== "%d") caml_failwith("Z.format: only %d");
  return caml_string_of_jsbytes(BigInt(x).toString());
}

//Provides: ml_z_of_substring_base
//Requires: ml_z_normal, caml_jsbytes_of_string, caml_invalid_argument
function ml_z_of_substring_base(base, text, offset, length) {
  var s = caml_jsbytes_of_string(text).substr(offset, length);
  var parts = /^([-+]?)([0-9a-fA-F]+)$/.exec(s), bad = "Z.of_substring_base: invalid digit";
  if (parts === null) caml_invalid_argument(bad);
  if ((base === 10 || base === 0) && /^[0-9]+$/.test(parts[2])) var x = BigInt(parts[2]);
  else if (base === 16) var x = BigInt("0x" + parts[2]);
  else caml_invalid_argument(bad);
  return ml_z_normal(parts[1] === "-" ? -x : x);
}

// The browser limits memory and time itself.
//Provides: ptcc_budget
function ptcc_budget(bytes, seconds, text) { return 0; }
