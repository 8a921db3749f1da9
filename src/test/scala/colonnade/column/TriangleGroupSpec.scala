package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, PopCount, Queue}
import chiseltest._
import colonnade.{Proofs, Simulation, TestConfigs}
import colonnade.traversal.{ExpectedHit, TestCandidate, TriangleHarness, TriangleStimulus}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** [[TriangleGroup]]: every row gets the results of its own records, whatever the others do. */
class TriangleGroupSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "TriangleGroup"

  for ((rows, of, lanes, stalls) <- Seq((3, 3, 2, 3), (2, 3, 1, 3), (1, 3, 1, 0), (1, 1, 2, 3)))
    it should s"return each result to its row, with $rows of $of rows on $lanes units, stalls $stalls" in {
      val tiny   = TestConfigs.tiny
      val config = tiny.copy(
        array = tiny.array.copy(contexts = 3),
        units = tiny.units.copy(triangleLanes = lanes, triangleRows = of)
      )
      val stimulus = new TriangleStimulus(config, seed = 5)
      val harness  = new TriangleHarness(config, stimulus)
      val random   = new Random(7)
      test(new TriangleGroup(config, rows)).withAnnotations(Simulation.verilator) { shared =>
        shared.clock.setTimeout(0)

        // By row: records that wait, and by context the results that are still to come
        val waiting        = Seq.fill(rows)(mutable.Queue.from(harness.random(60)))
        val awaited        = Seq.fill(rows)(mutable.Map.empty[Int, mutable.Queue[(Boolean, ExpectedHit)]])
        val mayOpen        = Array.fill(rows)(false)
        var (cycles, hits) = (0, 0)
        var busiest        = 0
        while (waiting.exists(_.nonEmpty) || awaited.exists(_.nonEmpty)) {
          cycles should be < 6000
          for (row <- 0 until rows) {
            val port = shared.io.rows(row)

            // A record of an idle context, in the cycle after the row may grant one
            def next: Option[TestCandidate] = waiting(row).headOption.filterNot(c => awaited(row).contains(c.context))
            val sends                       = next.filter(_ => mayOpen(row))
            for (candidate <- sends) {
              port.candidate.ready.expect(true)
              harness.poke(port.candidate.bits, candidate)
              awaited(row)(candidate.context) =
                mutable.Queue.from(harness.expected(Seq(candidate)).map(r => (r.isLast, r.hit)))
              waiting(row).dequeue()
            }
            port.candidate.valid.poke(sends.nonEmpty)
            shared.io.waits(row).poke(next.nonEmpty)

            val accepts = stalls == 0 || random.nextInt(stalls) == 0
            port.result.ready.poke(accepts)
            if (accepts && port.result.valid.peekBoolean()) {
              val context       = port.result.bits.context.peekInt().toInt
              val (isLast, hit) = awaited(row)(context).dequeue()
              port.result.bits.isLast.expect(isLast)
              port.result.bits.isHit.expect(hit.isHit)
              if (hit.isHit) harness.peek(port.result.bits.hit.t) shouldBe hit.t
              if (hit.isHit) hits += 1
              if (isLast) awaited(row).remove(context)
            }
          }
          busiest = busiest.max(shared.io.rows.head.busy.peekInt().toInt)
          for (row <- 0 until rows) mayOpen(row) = shared.io.rows(row).readyNext.peekBoolean()
          shared.clock.step()
          cycles += 1
        }
        hits should be > 20 * rows
        busiest shouldBe lanes
      }
    }
}

/** Drives [[TriangleGrants]] with rows that wait, and send what they may, at any time, and a queue that triangle units
  * empty at any time. As in [[TriangleGroup]], the units take a record in the cycle after they announce it, and perhaps
  * earlier.
  */
class TriangleGrantsProof(count: Int) extends Module {
  private val dut   = Module(new TriangleGrants(count)).io
  private val queue = Module(new Queue(UInt(1.W), TriangleGroup.queueDepth, flow = true)).io

  val waits     = IO(Input(UInt(count.W)))
  val sends     = IO(Input(UInt(count.W)))
  val readyNext = IO(Input(Bool()))
  val isReady   = IO(Input(Bool()))

  dut.waits       := waits
  dut.queued      := queue.count
  dut.readyNext   := readyNext
  queue.enq.valid := (dut.sender & sends).orR
  queue.enq.bits  := 0.U
  queue.deq.ready := RegNext(readyNext, false.B) || isReady

  assert(!queue.enq.valid || queue.enq.ready, "a record comes to a full queue")
  assert(PopCount(dut.grant) <= 1.U, "one row at a time")
  assert(dut.sender === RegNext(dut.grant, 0.U), "a row sends in the cycle after its grant")

  for (row <- 0 until count) {
    val others = RegInit(0.U(log2Ceil(count + 2).W))
    others := Mux(waits(row) && !dut.grant(row), others + dut.grant.orR, 0.U)
    assert(others <= count.U, "a row that keeps waiting is granted after at most as many others as there are rows")
  }

  private val granted = RegNext(dut.grant, 0.U)
  cover(dut.grant.orR && granted.orR && dut.grant =/= granted, "two rows in two cycles")
  cover(queue.count === TriangleGroup.queueDepth.U && dut.grant.orR, "a grant to a queue that empties")
}

class TriangleGrantsSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "TriangleGrants"

  for (count <- Seq(2, 3, 5))
    it should s"never overfill the queue, and starve none of $count rows" in
      prove(new TriangleGrantsProof(count))
}
