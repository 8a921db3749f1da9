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
}
