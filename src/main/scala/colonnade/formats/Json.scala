package colonnade.formats

import java.nio.charset.StandardCharsets.UTF_8
import java.security.MessageDigest

/** Writes JSON: indented for readers, canonical for hashes. */
object Json {

  /** Indented, with each innermost object or list on one line. */
  def pretty(json: ujson.Value): String = {
    def render(value: ujson.Value, indent: String): String = {
      val inner = indent + "  "
      value match {
        case flat if children(flat).forall(children(_).isEmpty) => oneLine(flat)
        case ujson.Obj(fields)                                  =>
          fields.map { case (key, field) => s"$inner${ujson.Str(key).render()}: ${render(field, inner)}" }
            .mkString("{\n", ",\n", s"\n$indent}")
        case list => list.arr.map(inner + render(_, inner)).mkString("[\n", ",\n", s"\n$indent]")
      }
    }
    render(json, "") + "\n"
  }

  /** SHA-256 of the JSON with sorted keys and no spaces. */
  def hash(json: ujson.Value): String =
    MessageDigest.getInstance("SHA-256").digest(sorted(json).render().getBytes(UTF_8)).map(b => f"$b%02x").mkString

  private def oneLine(json: ujson.Value): String = json match {
    case ujson.Obj(fields) =>
      fields.map { case (key, field) => s"${ujson.Str(key).render()}: ${oneLine(field)}" }.mkString("{", ", ", "}")
    case ujson.Arr(items) => items.map(oneLine).mkString("[", ", ", "]")
    case scalar           => scalar.render()
  }

  private def children(json: ujson.Value): Iterable[ujson.Value] = json match {
    case ujson.Obj(fields) => fields.values
    case ujson.Arr(items)  => items
    case _                 => Nil
  }

  private def sorted(json: ujson.Value): ujson.Value = json match {
    case ujson.Obj(fields) => ujson.Obj.from(fields.toSeq.sortBy(_._1).map { case (key, v) => key -> sorted(v) })
    case ujson.Arr(items)  => ujson.Arr.from(items.map(sorted))
    case scalar            => scalar
  }
}
