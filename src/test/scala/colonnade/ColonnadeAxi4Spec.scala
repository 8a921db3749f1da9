package colonnade

import chisel3._
import circt.stage.ChiselStage
import colonnade.examples.ColonnadeAxi4
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.nio.file.{Files, Path}

/** The black box of `examples/axi4` has the pins of its Verilog. */
class ColonnadeAxi4Spec extends AnyFlatSpec with Matchers {
  behavior of "ColonnadeAxi4"

  private def pins(name: String, data: Data): Seq[String] = data match {
    case bundle: Bundle => bundle.elements.toSeq.flatMap { case (field, element) => pins(s"${name}_$field", element) }
    case _              => Seq(name)
  }

  it should "have the pins of colonnade_axi4.sv" in {
    val text     = Files.readString(Path.of("examples", "axi4", "colonnade_axi4.sv"))
    val ports    = text.drop(text.indexOf(") (")).takeWhile(_ != '`')
    val expected = """\b(clock|reset|irq|[sm]_axi_\w+)\b""".r.findAllIn(ports).toSet
    var found    = Set.empty[String]
    ChiselStage.emitCHIRRTL(new RawModule {
      private val box = Module(new ColonnadeAxi4)
      box.io := DontCare
      found = box.io.elements.flatMap { case (name, data) => pins(name, data) }.toSet
    })
    found shouldBe expected
  }
}
