package colonnade.formats

import colonnade.config.ConfigIO
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.nio.file.{Files, Paths}

class FormatsPageSpec extends AnyFlatSpec with Matchers {
  behavior of "FormatsPage"

  it should "equal the page in docs" in {
    val current = Files.readString(Paths.get("docs", "formats.md"))
    withClue("out of date; run tools/regenerate: ") {
      assert(current == FormatsPage(ConfigIO.load("small")))
    }
  }

  it should "name every register at its address" in {
    for (preset <- Seq("tiny", "small", "lean")) {
      val config    = ConfigIO.load(preset)
      val registers = FormatsPage(config).split("## Registers").last.split("\n").toSeq
      val listed    = registers.collect { case Row(name, addresses) => expanded(name, addresses) }.flatten
      listed should contain theSameElementsAs RegisterMap(config).map(r => r.name -> r.address)
    }
  }

  it should "join fields of one letter, with or without a prefix" in {
    val fields = Seq(("y", 12, "u4"), ("x", 0, "u4"), ("a.y", 8, "u4"), ("a.x", 4, "u4"))
    FieldFamily.of(fields).map(each => each.pattern -> each.positions) shouldBe Seq("yx" -> "12, 0", "a.yx" -> "8, 4")
  }

  it should "refuse a family with a gap" in {
    an[IllegalArgumentException] should be thrownBy
      FieldFamily.of(Seq(("a[0]", 0, "u1"), ("a[1]", 1, "u1"), ("a[2]", 3, "u1")))
  }

  it should "name the memories of the maps in a table" in {
    FormatsPage(ConfigIO.load("small")) should include("\n|`albedo.descriptors`|1|")
  }

  private val Row   = """\|`(.*)`\|(.*\d.*)\|.*\|""".r
  private val Index = """\[([ijk])<(\d+)\]""".r
  private val Term  = """(\d*)([ijk]?)""".r

  /** Each name of a row with its position, by evaluating the row's terms such as `295+8i`. */
  private def expanded(name: String, positions: String): Seq[(String, Int)] = {
    val indexes = Index.findAllMatchIn(name).map(found => found.group(1) -> found.group(2).toInt).toSeq
    val values  = indexes.foldLeft(Seq(Map.empty[String, Int])) { case (before, (index, count)) =>
      for (known <- before; value <- 0 until count) yield known + (index -> value)
    }
    for {
      known <- values
      plain = Index.replaceAllIn(name, found => s"[${known(found.group(1))}]")
      sums  = positions.split(", ").map(_.split("\\+").map(evaluated(_, known)).sum).toSeq
      one <- if (sums.size == 1) Seq(plain -> sums.head) else letters(plain).zip(sums)
    } yield one
  }

  private def evaluated(term: String, indexes: Map[String, Int]): Int = term match {
    case Term(number, "")    => number.toInt
    case Term("", index)     => indexes(index)
    case Term(stride, index) => stride.toInt * indexes(index)
  }

  private def letters(name: String): Seq[String] = {
    val (prefix, end) = name.splitAt(name.lastIndexOf('.') + 1)
    end.map(letter => s"$prefix$letter")
  }
}
