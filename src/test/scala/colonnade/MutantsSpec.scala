package colonnade

import firrtl2._
import firrtl2.ir._
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

class MutantsSpec extends AnyFlatSpec with Matchers {
  behavior of "Mutants"

  private val number = UIntType(IntWidth(4))
  private val port   = Reference("a", number, PortKind, SourceFlow)

  private def at(line: Int, folder: String = "main") =
    FileInfo(s"src/$folder/scala/colonnade/unit/X.scala $line:5")

  private val inner = Module(
    NoInfo,
    "Inner",
    Seq(Port(NoInfo, "a", Input, number), Port(NoInfo, "o", Output, number)),
    Block(Seq(
      DefNode(at(3), "n", DoPrim(PrimOps.And, Seq(port, port), Nil, number)),
      DefNode(at(4, "test"), "m", DoPrim(PrimOps.Or, Seq(port, port), Nil, number)),
      Connect(at(5), Reference("o", number, PortKind, SinkFlow), Reference("n", number, NodeKind, SourceFlow))
    ))
  )
  private val outer = Module(
    NoInfo,
    "Outer",
    Nil,
    DefInstance(NoInfo, "i", "Inner", BundleType(Seq(Field("a", Flip, number), Field("o", Default, number))))
  )
  private val circuit = Circuit(NoInfo, Seq(inner, outer), "Outer")

  it should "change operations and bits of the hardware's sources, each by its number" in {
    val (changed, mutants) = Mutants.insert(circuit, Mutants.Choice(seed = 1, perFile = 9))
    mutants.map(_.name) should contain theSameElementsAs Seq("unit/X.scala 3:5 and→or 0", "unit/X.scala 5:5 bit 0")
    val text = changed.serialize
    for (mutant <- mutants) text should include(s"""mux(eq(mutant, UInt<31>("h${mutant.number.toString(16)}"))""")
    text should include("or(a, a), and(a, a)")
    text should include("node m = or(a, a)")
    text should include("i.mutant <= mutant")
  }

  it should "choose faults by a seed" in {
    val selected = (1 to 20).map(seed => Mutants.insert(circuit, Mutants.Choice(seed, perFile = 1))._2.map(_.name))
    selected.map(_.size).toSet shouldBe Set(1)
    selected.toSet.size shouldBe 2
  }
}
