package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder, PriorityMux}
import chiseltest._
import chiseltest.formal._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Try

class TraversalStackFormalSpec extends AnyFlatSpec with ChiselScalatestTester with Formal {
  private def config(arity: Int): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = 2),
    geometry = TestConfigs.tiny.geometry.copy(vertexBits = 10, arity = arity),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(depth = 16, stackDepth = 4)
  )
  private def hasZ3 = Try(new ProcessBuilder("z3", "--version").redirectErrorStream(true).start().waitFor() == 0).getOrElse(false)

  behavior of "TraversalStack"

  for ((arity, cycles) <- Seq((2, 10), (4, 9)))
    it should s"give back what was pushed, in order and once, whatever the other context does, arity $arity" in {
      assume(hasZ3, "z3 is not installed")
      verify(new TraversalStackProof(config(arity)), Seq(BoundedCheck(cycles), Z3EngineAnnotation))
    }
}

/** Follows context 0 of two in registers of its own; context 1 and all handshakes are free within the contract. */
private class TraversalStackProof(config: ColonnadeConfig) extends Module {
  private val stackDepth = config.columnBvhMemory.stackDepth
  private val arity      = config.geometry.arity

  val io = IO(new TraversalStackIO(config))

  private val stack = Module(new TraversalStack(config))
  stack.io :<>= io

  // The contract: offers are constant until taken; a context has one operation under way; limits hold meanwhile
  private val underWay = RegInit(VecInit.fill(2)(false.B))
  private def holds(valid: Bool, ready: Bool, bits: Data): Unit = {
    val waits = RegNext(valid && !ready, false.B)
    val bound = RegNext(bits.asUInt)
    assume(!waits || (valid && bits.asUInt === bound))
  }
  holds(io.results.valid, io.results.ready, io.results.bits)
  holds(io.resume.valid, io.resume.ready, io.resume.bits)
  assume(!io.results.valid || io.results.bits.count <= arity.U)
  for (child <- io.results.bits.children) assume(child.near.integer >= 0.S)
  for (context <- 0 until 2) {
    val found   = io.results.valid && io.results.bits.context === context.U
    val resumes = io.resume.valid && io.resume.bits === context.U
    val starts  = io.start.valid && io.start.bits === context.U
    assume(!(found && resumes) && !(starts && (found || resumes)))
    assume(!underWay(context) || !(found || resumes || starts))
    when((found && io.results.ready) || (resumes && io.resume.ready))(underWay(context) := true.B)
    when(io.visits.fire && io.visits.bits.context === context.U) {
      underWay(context) := false.B
      assert(underWay(context), "a visit that nobody asked for")
    }
    val waits      = RegNext((found && !io.results.ready) || (resumes && !io.resume.ready), false.B)
    val limitBound = RegNext(io.limits(context).integer)
    assume(!waits || io.limits(context).integer === limitBound)
  }

  // Context 0 as it should be, newest entry first
  private val entries  = Reg(Vec(stackDepth, new EnteredChild(config)))
  private val level    = RegInit(0.U(log2Ceil(stackDepth + 1).W))
  private val expected = Reg(new NextVisit(config))

  private def pop(): Unit = {
    val counts = entries.zipWithIndex.map { case (entry, i) => i.U < level && entry.near.integer <= io.limits(0).integer }
    val none   = !VecInit(counts).asUInt.orR
    val taken  = PriorityEncoder(counts)
    expected.isDone := none
    expected.visit  := PriorityMux(counts, entries).visit
    level           := Mux(none, 0.U, level - taken - 1.U)
    for (i <- 0 until stackDepth)
      entries(i) := PriorityMux(counts, (0 until stackDepth).map(gone => entries((i + gone + 1).min(stackDepth - 1))))
  }

  private val result = io.results.bits
  when(io.results.fire && result.context === 0.U) {
    when(result.count === 0.U)(pop()).otherwise {
      expected.isDone := false.B
      expected.visit  := result.children(0).visit
      // The far ones that fit; the nearest of them is the newest
      val wanted = result.count - 1.U
      val room   = stackDepth.U - level
      val fits   = Mux(wanted < room, wanted, room)
      level := level + fits
      for (count <- 1 until arity) when(fits === count.U) {
        for (i <- 0 until stackDepth)
          entries(i) := (if (i < count) result.children((result.count - count.U + i.U)(log2Ceil(arity) - 1, 0)) else entries(i - count))
      }
    }
  }
  when(io.resume.fire && io.resume.bits === 0.U)(pop())
  when(io.start.valid && io.start.bits === 0.U)(level := 0.U)

  when(io.visits.valid && io.visits.bits.context === 0.U) {
    assert(io.visits.bits.isDone === expected.isDone)
    when(!expected.isDone)(assert(io.visits.bits.visit.asUInt === expected.visit.asUInt))
  }
}
