//! h(x, y) as an expression in a scenario: `0.3*exp(-x^2) + max(0, 0.1*sin(2*y))`.
//!
//! The usual precedence: `^` binds tightest and from the right, then signs, then `* /`, then `+ -`. So −x^2 = −(x²), as in
//! Python. (A parser in which signs bind tighter than powers would silently turn exp(−x^2) into a cliff.)

use crate::error::{Error, Result};

/// Longer expressions are refused; this also bounds the depth of the tree.
const MAX_LENGTH: usize = 2000;

/// The key that messages name.
const KEY: &str = "terrain.expression";

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

const FUNCTIONS: [(&str, Unary); 21] = [
    ("abs", f64::abs),
    ("sign", |v| if v == 0.0 { 0.0 } else { v.signum() }),
    ("floor", f64::floor),
    ("ceil", f64::ceil),
    ("round", f64::round),
    ("sqrt", f64::sqrt),
    ("cbrt", f64::cbrt),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log", f64::ln),
    ("log10", f64::log10),
    ("log2", f64::log2),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
];

const FUNCTIONS_OF_TWO: [(&str, Binary); 5] = [
    ("min", f64::min),
    ("max", f64::max),
    ("atan2", f64::atan2),
    ("hypot", f64::hypot),
    ("mod", f64::rem_euclid),
];

const CONSTANTS: [(&str, f64); 3] =
    [("pi", std::f64::consts::PI), ("tau", std::f64::consts::TAU), ("e", std::f64::consts::E)];

/// A parsed expression in x and y.
pub struct Formula {
    text: String,
    root: Node,
}

enum Node {
    Number(f64),
    X,
    Y,
    Unary(Unary, Box<Node>),
    Binary(Binary, Box<(Node, Node)>),
}

impl Formula {
    /// Parses an expression.
    ///
    /// # Errors
    /// [`Error::Key`] with the character at which the expression is wrong, and what is allowed there.
    pub fn parse(text: &str) -> Result<Self> {
        if text.len() > MAX_LENGTH {
            let what = format!(
                "given {} characters, allowed: at most {MAX_LENGTH} (a heightmap can hold more detail)",
                text.len()
            );
            return Err(Error::key(KEY, what));
        }
        let mut parser = Parser { text, position: 0, depth: 0 };
        let root = parser.sum()?;
        match parser.peek() {
            None => Ok(Self { text: text.into(), root }),
            Some(')') => Err(parser.error("unmatched ')'")),
            Some(_) => Err(parser.error("expected an operator (multiplication is written *)")),
        }
    }

    /// h(x, y).
    ///
    /// # Errors
    /// [`Error::Key`] with x and y, where the value is not a finite number.
    pub fn height(&self, x: f64, y: f64) -> Result<f64> {
        let h = self.root.value(x, y);
        if h.is_finite() {
            return Ok(h);
        }
        let what = format!(
            "{:?} is {h} at x = {x:.4}, y = {y:.4}; it must be a finite height everywhere in terrain.extent",
            self.text
        );
        Err(Error::key(KEY, what))
    }
}

impl Node {
    fn value(&self, x: f64, y: f64) -> f64 {
        match self {
            Node::Number(v) => *v,
            Node::X => x,
            Node::Y => y,
            Node::Unary(f, a) => f(a.value(x, y)),
            Node::Binary(f, operands) => f(operands.0.value(x, y), operands.1.value(x, y)),
        }
    }
}

/// Recursive descent; one method per level of precedence.
struct Parser<'a> {
    text: &'a str,
    /// In bytes, always at the start of a character.
    position: usize,
    depth: usize,
}

impl Parser<'_> {
    /// sum = product { ("+" | "-") product }
    fn sum(&mut self) -> Result<Node> {
        let mut left = self.product()?;
        loop {
            let f: Binary = match self.peek() {
                Some('+') => |a, b| a + b,
                Some('-') => |a, b| a - b,
                _ => return Ok(left),
            };
            self.position += 1;
            left = binary(f, left, self.product()?);
        }
    }

    /// product = signed { ("*" | "/") signed }
    fn product(&mut self) -> Result<Node> {
        let mut left = self.signed()?;
        loop {
            let f: Binary = match self.peek() {
                Some('*') => |a, b| a * b,
                Some('/') => |a, b| a / b,
                _ => return Ok(left),
            };
            self.position += 1;
            left = binary(f, left, self.signed()?);
        }
    }

    /// signed = ("+" | "-") signed | power
    fn signed(&mut self) -> Result<Node> {
        self.depth += 1;
        if self.depth > 200 {
            return Err(self.error("too deeply nested"));
        }
        let node = match self.peek() {
            Some('-') => {
                self.position += 1;
                Node::Unary(|v| -v, Box::new(self.signed()?))
            }
            Some('+') => {
                self.position += 1;
                self.signed()?
            }
            _ => self.power()?,
        };
        self.depth -= 1;
        Ok(node)
    }

    /// power = atom [ ("^" | "**") signed ]
    fn power(&mut self) -> Result<Node> {
        let base = self.atom()?;
        let operator = match self.peek() {
            Some('^') => 1,
            Some('*') if self.text[self.position..].starts_with("**") => 2,
            _ => return Ok(base),
        };
        self.position += operator;
        let exponent = self.signed()?;
        // Squares by multiplication: exact, and fast.
        if let Node::Number(n) = exponent
            && n == 2.0
        {
            return Ok(Node::Unary(|v| v * v, Box::new(base)));
        }
        Ok(binary(f64::powf, base, exponent))
    }

    /// atom = number | "(" sum ")" | name [ "(" sum [ "," sum ] ")" ]
    fn atom(&mut self) -> Result<Node> {
        match self.peek() {
            Some('(') => {
                self.position += 1;
                let inside = self.sum()?;
                self.expect(')')?;
                Ok(inside)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            Some(_) => Err(self.error("expected a number, x, y, a function or a parenthesis")),
            None => Err(self.error("the expression ends too early")),
        }
    }

    fn number(&mut self) -> Result<Node> {
        let rest = &self.text[self.position..];
        let digits = |from: usize| from + rest[from..].bytes().take_while(u8::is_ascii_digit).count();
        let mut end = digits(0);
        if rest[end..].starts_with('.') {
            end = digits(end + 1);
        }
        if rest[end..].starts_with(['e', 'E']) {
            let sign = end + 1 + usize::from(rest[end + 1..].starts_with(['+', '-']));
            let exponent = digits(sign);
            if exponent > sign {
                end = exponent;
            }
        }
        let value = rest[..end].parse().map_err(|_| self.error("this is not a number"))?;
        self.position += end;
        Ok(Node::Number(value))
    }

    fn name(&mut self) -> Result<Node> {
        let rest = &self.text[self.position..];
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let name = &rest[..end];
        let start = self.position;
        self.position += end;
        if let Some((_, f)) = FUNCTIONS.iter().find(|(n, _)| *n == name) {
            self.expect('(')?;
            let argument = self.sum()?;
            self.expect(')')?;
            return Ok(Node::Unary(*f, Box::new(argument)));
        }
        if let Some((_, f)) = FUNCTIONS_OF_TWO.iter().find(|(n, _)| *n == name) {
            self.expect('(')?;
            let first = self.sum()?;
            self.expect(',')?;
            let second = self.sum()?;
            self.expect(')')?;
            return Ok(binary(*f, first, second));
        }
        match name {
            "x" => return Ok(Node::X),
            "y" => return Ok(Node::Y),
            _ => (),
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(n, _)| n.eq_ignore_ascii_case(name)) {
            return Ok(Node::Number(*value));
        }
        self.position = start;
        Err(self.error(&format!(
            "{name:?} is unknown; allowed: the variables x and y, the constants {}, and the functions {} {}",
            names(&CONSTANTS),
            names(&FUNCTIONS),
            names(&FUNCTIONS_OF_TWO)
        )))
    }

    fn expect(&mut self, wanted: char) -> Result<()> {
        if self.peek() == Some(wanted) {
            self.position += wanted.len_utf8();
            return Ok(());
        }
        Err(self.error(&format!("expected {wanted:?}")))
    }

    /// The next character that is not a space, without consuming it.
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.position..];
        self.position += rest.len() - rest.trim_start().len();
        self.text[self.position..].chars().next()
    }

    fn error(&self, what: &str) -> Error {
        let column = self.text[..self.position].chars().count() + 1;
        Error::key(KEY, format!("{:?}, character {column}: {what}", self.text))
    }
}

fn binary(f: Binary, left: Node, right: Node) -> Node {
    Node::Binary(f, Box::new((left, right)))
}

fn names<T>(table: &[(&str, T)]) -> String {
    table.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_mean_what_they_mean_in_mathematics() {
        let (x, y) = (1.7_f64, -0.6_f64);
        let cases = [
            ("-x^2", -x * x),
            ("exp(-x^2)", (-x * x).exp()),
            ("2^-x", 2.0_f64.powf(-x)),
            ("2^3^2", 512.0),
            ("x**2 - y ** 3", x * x - y * y * y),
            ("2 - 3 - x", -1.0 - x),
            ("8/4/x", 2.0 / x),
            ("2*-x", -2.0 * x),
            ("- -x+ +y", x + y),
            ("1e-3*x + 1.5E2 + .5 + 2.", 1e-3 * x + 152.5),
            ("0.1*sin(2*x)*cos(y)", 0.1 * (2.0 * x).sin() * y.cos()),
            ("max(x, y) + min(0, y) - abs(y)", x + y + y),
            ("atan2(y, x) + hypot(x, y) + mod(y, 1)", y.atan2(x) + x.hypot(y) + 0.4),
            ("cos(PI) + ln(e) + tau", std::f64::consts::TAU),
            ("sign(y) + sign(0)", -1.0),
            ("((x))", x),
            ("0.3", 0.3),
        ];
        for (text, expected) in cases {
            let value = Formula::parse(text).unwrap().height(x, y).unwrap();
            assert!((value - expected).abs() < 1e-12, "{text}: {value} against {expected}");
        }
    }

    #[test]
    fn errors_say_where_and_what() {
        let deep = "(".repeat(900) + "x" + &")".repeat(900);
        let signs = "-".repeat(1500) + "x";
        let long = "x+".repeat(1500) + "x";
        let cases = [
            ("", "character 1: the expression ends too early"),
            ("   ", "ends too early"),
            ("x +", "ends too early"),
            ("2x", "character 2: expected an operator"),
            ("x y", "character 3: expected an operator"),
            ("(x", "expected ')'"),
            ("x)", "unmatched"),
            ("sin x", "expected '('"),
            ("max(x)", "expected ','"),
            ("z + x", "\"z\" is unknown"),
            ("x * foo(y)", "character 5: \"foo\" is unknown"),
            ("x > 0", "expected an operator"),
            ("*x", "expected a number, x, y"),
            ("1.2.3", "expected an operator"),
            (".", "not a number"),
            ("x²", "\"x²\" is unknown"),
            ("é", "\"é\" is unknown"),
            (&deep, "too deeply"),
            (&signs, "too deeply"),
            (&long, "at most 2000"),
        ];
        for (text, part) in cases {
            let message = Formula::parse(text).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(message.contains(part), "{text:?}: {message}");
        }
    }

    #[test]
    fn values_that_are_not_heights_are_refused_with_their_position() {
        for text in ["1/x", "ln(x)", "sqrt(x-1)", "0/x", "exp(1000 + x)"] {
            let message = Formula::parse(text).unwrap().height(0.0, 0.25).unwrap_err().to_string();
            assert!(message.contains("at x = 0.0000, y = 0.2500"), "{message}");
        }
    }

    #[test]
    fn long_sums_are_fine() {
        let text = vec!["x"; 900].join("+");
        assert!((Formula::parse(&text).unwrap().height(2.0, 0.0).unwrap() - 1800.0).abs() < 1e-9);
    }
}
