package colonnade.unit

import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random
import colonnade.TestParts._

/** The first ready context of the kind with the highest priority is granted in the next cycle. */
class RecordGrantSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RecordGrant"

  private val contexts = 5
  private val buffers  = 3
  private val config   = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(recordBuffers = buffers)
  )

  it should "serve triangles before attributes before nodes, and only kinds whose unit accepts a record" in
    test(new RecordGrant(config)) { dut =>
      val random   = new Random(7)
      val priority = Seq(RecordKind.leaf, RecordKind.colours, RecordKind.node)
      var granted  = Option.empty[(Int, RecordKind.Type, Int)]
      for (_ <- 0 until 1000) {
        val ready   = Seq.fill(contexts)(random.nextInt(3) == 0)
        val kinds   = Seq.fill(contexts)(RecordKind.all(random.nextInt(3)))
        val holders = Seq.fill(contexts)(random.nextInt(buffers))
        val accepts = RecordKind.all.map(_.litValue -> random.nextBoolean()).toMap
        for (context <- 0 until contexts) {
          dut.io.isReady(context).poke(ready(context))
          dut.io.kinds(context).poke(kinds(context))
          for (buffer <- 0 until buffers) dut.io.holders(context)(buffer).poke(holders(context) == buffer)
        }
        for ((kind, port) <- RecordKind.all.zip(dut.io.readyNext)) port.poke(accepts(kind.litValue))
        dut.io.granted.valid.expect(granted.nonEmpty)
        for ((context, kind, holder) <- granted) {
          dut.io.granted.bits.context.expect(context)
          dut.io.granted.bits.kind.expect(kind)
          for (buffer <- 0 until buffers) dut.io.granted.bits.buffer(buffer).expect(buffer == holder)
        }
        granted = (for {
          kind    <- priority if accepts(kind.litValue)
          context <- 0 until contexts if ready(context) && kinds(context).litValue == kind.litValue
        } yield (context, kind, holders(context))).headOption
        dut.io.grantNext.valid.expect(granted.nonEmpty)
        dut.io.grantsNodeNext.expect(granted.exists(_._2.litValue == RecordKind.node.litValue))
        for ((context, _, _) <- granted) dut.io.grantNext.bits.expect(context)
        for (context <- 0 until contexts) dut.io.grantOH(context).expect(granted.exists(_._1 == context))
        dut.clock.step()
      }
    }
}
