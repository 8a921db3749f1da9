package colonnade.config

import scala.collection.mutable
import upickle.core.{ObjVisitor, Visitor}

/** Reads JSON without its traps: an object with a key twice, deep nesting and overlong numbers are refused. */
private[config] object StrictJson {

  /** Nested arrays and objects; characters of a number. */
  val maxDepth:  Int = 64
  val maxDigits: Int = 40

  /** @param source for messages
    * @throws ujson.ParsingFailedException it is no JSON
    */
  def read(text: String, source: String): ujson.Value = {
    checkNesting(text, source)
    ujson.transform(text, new Values(source))
  }

  /** The parser itself recurses: its stack must not depend on the text. Strings are passed over. */
  private def checkNesting(text: String, source: String): Unit = {
    var depth    = 0
    var isString = false
    var at       = 0
    while (at < text.length) {
      text(at) match {
        case '\\' if isString       => at += 1
        case '"'                    => isString = !isString
        case '[' | '{' if !isString =>
          depth += 1
          if (depth > maxDepth) throw new ConfigError(s"$source is nested too deeply: $maxDepth levels at most")
        case ']' | '}' if !isString => depth -= 1
        case _                      =>
      }
      at += 1
    }
  }

  private final class Values(source: String) extends ujson.AstTransformer[ujson.Value] {

    def transform[T](value: ujson.Value, to: Visitor[_, T]): T = ujson.Value.transform(value, to)

    def visitArray(length: Int, index: Int) = new AstArrVisitor[mutable.ArrayBuffer](ujson.Arr(_))

    def visitJsonableObject(length: Int, index: Int): ObjVisitor[ujson.Value, ujson.Value] =
      new ObjVisitor[ujson.Value, ujson.Value] {
        private val fields = mutable.LinkedHashMap.empty[String, ujson.Value]
        private var key    = ""

        def subVisitor: Visitor[_, _]           = Values.this
        def visitKey(index: Int): Visitor[_, _] = upickle.core.StringVisitor
        def visitKeyValue(value: Any): Unit     = {
          key = value.toString
          if (fields.contains(key)) throw new ConfigError(s"$source has the key $key twice in an object")
        }
        def visitValue(value: ujson.Value, index: Int): Unit = fields(key) = value
        def visitEnd(index:   Int): ujson.Value              = ujson.Obj.from(fields)
      }

    def visitNull(index:  Int): ujson.Value = ujson.Null
    def visitFalse(index: Int): ujson.Value = ujson.False
    def visitTrue(index:  Int): ujson.Value = ujson.True

    def visitFloat64StringParts(number: CharSequence, point: Int, exponent: Int, index: Int): ujson.Value = {
      if (number.length > maxDigits) throw new ConfigError(s"$source has a number of ${number.length} characters")
      val value = number.toString.toDouble
      if (value.isInfinite) throw new ConfigError(s"$source has the number $number, which is too large")
      ujson.Num(value)
    }

    override def visitFloat64(number: Double, index: Int): ujson.Value = ujson.Num(number)

    def visitString(text: CharSequence, index: Int): ujson.Value = ujson.Str(text.toString)
  }
}
