package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, PopCount, Queue}

/** Drives [[TriangleGrants]] with rows that wait, and send what they may, at any time, and a queue that triangle units empty
  * at any time. As in [[TriangleGroup]], the units take a record in the cycle after they announce it, and perhaps earlier.
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
