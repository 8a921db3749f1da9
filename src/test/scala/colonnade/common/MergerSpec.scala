package colonnade.common

import chisel3._
import chisel3.util.{Decoupled, PopCount}
import chiseltest._
import colonnade.Proofs
import org.scalatest.flatspec.AnyFlatSpec

/** Any items at any time, taken at any time. */
class MergerProof(count: Int) extends Module {
  val givers = IO(Flipped(Vec(count, Decoupled(UInt(2.W)))))
  val items  = IO(Decoupled(UInt(2.W)))

  private val merger = Module(new Merger(UInt(2.W), count)).io
  merger.givers :<>= givers
  items :<>= merger.items

  private val gives = VecInit(givers.map(_.fire)).asUInt
  assert(items.valid === VecInit(givers.map(_.valid)).asUInt.orR, "an item when there is one")
  assert(PopCount(gives) === items.fire.asUInt, "each item is of one stream")

  for (giver <- givers) {
    when(giver.fire) { assert(items.bits === giver.bits, "the item of the stream that gives") }
    val waited = RegInit(0.U(3.W))
    when(giver.fire || !giver.valid) { waited := 0.U }.elsewhen(items.fire) { waited := waited + 1.U }
    assert(waited < count.U, "nobody waits for more than the others")
  }
}

class MergerSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "Merger"

  for (count <- Seq(1, 2, 3)) {
    it should s"give each item of $count streams once, and starve none" in {
      prove(new MergerProof(count))
    }
  }
}
