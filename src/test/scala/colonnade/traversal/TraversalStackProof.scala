package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Fill, PriorityEncoder, RegEnable}
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.NodeRecord
import colonnade.numbers.Fixed

/** Drives results, resumptions, starts, tMax and stalls of all contexts as freely as the contract of the stack allows.
  * It compares the steps of one context, which is free, with a plain stack.
  *
  * To keep the proof small, each address and each entry distance is all zeros or all ones, chosen per child; so is tMax
  * but for its sign. These bits identify an entry, because any two entries may differ in them.
  */
private[traversal] final class TraversalStackProof(config: ColonnadeConfig) extends Module {
  private val arity      = NodeRecord.most
  private val contexts   = config.array.contexts
  private val stackDepth = config.columnBvhMemory.stackDepth
  require(contexts == 2)

  val resultValid = IO(Input(Bool()))
  val found       = IO(Input(new FoundChildren(arity)))
  val resumes     = IO(Input(Bool()))
  val resumed     = IO(Input(UInt(1.W)))
  val starts      = IO(Input(Bool()))
  val started     = IO(Input(UInt(1.W)))
  val tMaxUnits   = IO(Input(Vec(contexts, UInt(2.W))))
  val ready       = IO(Input(Bool()))
  val observed    = IO(Input(UInt(1.W)))

  private val dut     = Module(new TraversalStack(config))
  private val step    = dut.io.steps
  private val accepts = dut.io.results.fire || dut.io.resume.fire

  // Drive the stack
  dut.io.results.valid        := resultValid
  dut.io.results.bits         := 0.U.asTypeOf(dut.io.results.bits)
  dut.io.results.bits.context := found.context
  dut.io.results.bits.count   := found.count
  for ((child, i) <- dut.io.results.bits.children.zipWithIndex) {
    child.target.isLeaf  := (i == 0).B // only the nearest, which is not pushed
    child.target.address := Fill(child.target.address.getWidth, found.marks(i))
    child.tNear          := Fixed(child.tNear.format, Fill(child.tNear.format.width - 1, found.isFar(i)).zext)
  }
  dut.io.resume.valid := resumes
  dut.io.resume.bits  := resumed
  dut.io.start.valid  := starts
  dut.io.start.bits   := started
  private val limit  = tMaxUnits(dut.io.tMax.context)
  private val format = dut.io.tMax.units.format
  dut.io.tMax.units := Fixed(format, (limit(1) ## Fill(format.width - 1, limit(0))).asSInt)
  dut.io.clear      := false.B
  step.ready        := ready

  // The contract: one operation per context at a time, a waiting result is stable, a start without an operation
  private val underWay = RegInit(VecInit.fill(contexts)(false.B))
  private val stays    = RegNext(resultValid && !dut.io.results.ready, false.B)
  assume(found.count <= arity.U)
  assume(!resultValid || !underWay(found.context))
  assume(!resumes || !(underWay(resumed) || (resultValid && found.context === resumed)))
  assume(
    !starts || !(underWay(started) || (resultValid && found.context === started) || (resumes && resumed === started))
  )
  assume(!stays || (resultValid && found.asUInt === RegNext(found.asUInt)))
  when(step.fire) { underWay(step.bits.context) := false.B }
  when(dut.io.results.fire) { underWay(found.context) := true.B }
  when(dut.io.resume.fire) { underWay(resumed) := true.B }

  assert(!(dut.io.results.fire && dut.io.resume.fire), "one operation at a time")
  assert(!step.valid || underWay(step.bits.context), "no step without an operation")
  assert(!underWay.reduce(_ || _) || dut.io.busy, "busy while an operation is in flight")

  // Reference stack of the observed context, newest entry first
  private val isFirst  = RegNext(false.B, true.B)
  private val context  = Mux(isFirst, observed, RegEnable(observed, isFirst))
  private val entries  = RegInit(VecInit.fill(stackDepth)(0.U.asTypeOf(new ProofEntry)))
  private val level    = RegInit(0.U(log2Ceil(stackDepth + 1).W))
  private val isFound  = dut.io.results.fire && found.context === context
  private val pops     = (isFound && found.count === 0.U) || (dut.io.resume.fire && resumed === context)
  private val tMax     = tMaxUnits(context)
  private val isCulled = entries.map(_.isBeyond(tMax))
  private val counts   = VecInit(isCulled.zipWithIndex.map { case (culled, i) => i.U < level && !culled })
  private val isEmpty  = !counts.asUInt.orR
  private val drops    = PriorityEncoder(counts)

  // Push all children but the nearest, the farthest first
  private val pushed = (1 until arity).reverse.foldLeft(Pushed(entries, level, 0.U)) { case (before, i) =>
    val isPushed = found.count > i.U
    val isFull   = before.level === stackDepth.U
    val goesOn   = isPushed && !isFull
    val after    = ProofEntry(found.marks(i), found.isFar(i)) +: before.entries.init
    Pushed(
      VecInit(before.entries.zip(after).map { case (old, young) => Mux(goesOn, young, old) }),
      before.level + goesOn,
      before.lost +& (isPushed && isFull)
    )
  }
  when(pops) {
    level := Mux(isEmpty, 0.U, level - drops - 1.U)
    for ((entry, i) <- entries.zipWithIndex)
      entry := VecInit((1 to stackDepth).map(n => entries((i + n).min(stackDepth - 1))))(drops)
  }.elsewhen(isFound) {
    level   := pushed.level
    entries := pushed.entries
  }.elsewhen(starts && started === context) {
    level := 0.U
  }

  // Overflows of a result
  private val overflows = RegInit(0.U(log2Ceil(arity).W))
  overflows := Mux(dut.io.results.fire, 0.U, overflows + dut.io.overflow)
  assert(!dut.io.overflow || resultValid, "an overflow of nothing")
  assert(
    !isFound || overflows +& dut.io.overflow === Mux(pops, 0.U, pushed.lost),
    "an overflow for each entry that does not fit, and for no other"
  )

  // The step
  private val isDone    = RegEnable(pops && isEmpty, isFound || pops)
  private val isPopped  = RegEnable(pops, isFound || pops)
  private val mark      = RegEnable(Mux(pops, entries(drops).mark, found.marks(0)), isFound || pops)
  private val stepsHere = step.fire && step.bits.context === context
  when(stepsHere) {
    assert(step.bits.isDone === isDone, "done when no entry within tMax is left")
    assert(isDone || step.bits.target.isLeaf === !isPopped, "the nearest child, or else an entry")
    assert(isDone || step.bits.target.address === Fill(step.bits.target.address.getWidth, mark), "the right entry")
  }

  // While steps are accepted, operations and steps have a bounded latency, and the arbiter is fair
  private val unanswered = RegInit(0.U(4.W))
  private val waiting    = RegInit(0.U(4.W))
  unanswered := Mux(underWay(context) && !stepsHere, unanswered + ready, 0.U)
  waiting    := Mux(accepts || !(resultValid || resumes), 0.U, waiting + ready)
  assert(unanswered <= (stackDepth + 2).U, "a step soon after each operation")
  assert(waiting <= (stackDepth + 2).U, "operations are accepted")
  for ((one, other) <- Seq(dut.io.results -> dut.io.resume, dut.io.resume -> dut.io.results)) {
    val isPassedOver = RegInit(false.B)
    isPassedOver := one.valid && !one.ready && (isPassedOver || other.fire)
    assert(!(isPassedOver && one.valid && other.fire), "the arbiter is fair")
  }

  // What has to happen for this to say something; with two children an overflow takes too many cycles
  private val wasFull = RegInit(false.B)
  private val ended   = RegEnable(level =/= 0.U, isFound || pops)
  private val culled  = RegEnable(drops, isFound || pops)
  when(isFound && !pops && pushed.lost =/= 0.U) { wasFull := true.B }
  cover(stepsHere && isPopped && !isDone && culled > 1.U, "an entry below two that are culled")
  cover(stepsHere && isPopped && isDone && ended, "all entries are culled")
  cover(underWay.reduce(_ && _) && step.valid && RegNext(step.valid && !ready, false.B), "both contexts wait")
  if (arity > 2) cover(stepsHere && isPopped && !isDone && wasFull, "an entry after an overflow")
}

/** A result in the proof: bit i belongs to child i. */
private[traversal] final class FoundChildren(arity: Int) extends Bundle {
  val context = UInt(1.W)
  val count   = UInt(log2Ceil(arity + 1).W)
  val marks   = UInt(arity.W)
  val isFar   = UInt(arity.W)
}

private final class ProofEntry extends Bundle {
  val mark  = Bool()
  val isFar = Bool()

  /** The entry distance is 0 or the maximum; bit 1 of tMax is its sign, bit 0 stands for all others. */
  def isBeyond(tMax: UInt): Bool = tMax(1) || (isFar && !tMax(0))
}

private object ProofEntry {
  def apply(mark: Bool, isFar: Bool): ProofEntry = {
    val entry = Wire(new ProofEntry)
    entry.mark  := mark
    entry.isFar := isFar
    entry
  }
}

/** After some pushes. */
private final case class Pushed(entries: Vec[ProofEntry], level: UInt, lost: UInt)
