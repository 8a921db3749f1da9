package colonnade.traversal

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.NodeRecord
import colonnade.traversal.StackReference.Child
import colonnade.{Always, Matrix, Proofs, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

class TraversalStackSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  private def config(stackDepth: Int, contexts: Int): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(stackDepth = stackDepth)
  )

  private def withExtraSlices(config: ColonnadeConfig): ColonnadeConfig =
    config.copy(units = config.units.copy(extraSlices = true))

  behavior of "TraversalStack"

  for {
    ((stackDepth, contexts), i) <- Seq((16, 4), (5, 3), (6, 8), (4, 1)).zipWithIndex
    extraSlices                 <- Seq(false, true)
  }
    it should s"walk like the reference under random stalls, $stackDepth entries, $contexts contexts, extra slices $extraSlices" taggedAs
      Always.unless(extraSlices == (i % 2 == 0)) in {
        val plain = config(stackDepth, contexts)
        val shape = if (extraSlices) withExtraSlices(plain) else plain
        test(new TraversalStack(shape)).withAnnotations(Simulation.verilator) { dut =>
          for ((accepted, seed) <- Seq((1.0, 1), (0.4, 2))) {
            new StackDriver(dut, shape, seed).run(operations = 400, accepted)
          }
        }
      }

  for ((cycles, extraSlices) <- Seq((10, false), (13, true)))
    it should s"neither lose, duplicate nor reorder entries, and cull only those beyond tMax, extra slices $extraSlices" taggedAs Matrix in {
      val plain = config(stackDepth = 4, contexts = 2)
      val shape = if (extraSlices) withExtraSlices(plain) else plain
      proveUntil(cycles) {
        new TraversalStackProof(
          shape.copy(
            geometry = shape.geometry.copy(vertexBits = 10),
            columnBvhMemory = shape.columnBvhMemory.copy(depth = 16)
          )
        )
      }
    }

  it should "pop one entry per cycle while it culls those beyond tMax" in {
    val shape = config(stackDepth = 16, contexts = 2)
    test(new TraversalStack(shape)) { dut =>
      val driver = new StackDriver(dut, shape, seed = 1)
      for (round <- 0 until 3)
        driver.send(0, Seq.tabulate(4)(i => Child(isLeaf = false, 10 * round + i, if (round == 0) 5 else 100)))
      dut.io.deepest.expect(9.U)
      driver.setLimit(0, 50)
      val waited = driver.resume(0)
      assert(waited == 1 + 6, "six entries lie above the first that counts")
    }
  }

  it should "pop an entry every two cycles with extra slices" in {
    val shape = withExtraSlices(config(stackDepth = 16, contexts = 2))
    test(new TraversalStack(shape)) { dut =>
      val driver = new StackDriver(dut, shape, seed = 1)
      for (round <- 0 until 3)
        driver.send(0, Seq.tabulate(4)(i => Child(isLeaf = false, 10 * round + i, if (round == 0) 5 else 100)))
      driver.setLimit(0, 50)
      val waited = driver.resume(0)
      assert(waited == 1 + 1 + 2 * 6 + 1, "six entries lie above the first that counts; the step takes a cycle more")
    }
  }

  it should "push one child per cycle, and give the nearest child in the next cycle" in {
    val shape = config(stackDepth = 16, contexts = 2)
    test(new TraversalStack(shape)) { dut =>
      val driver = new StackDriver(dut, shape, seed = 1)
      for (count <- 1 to 4)
        assert(driver.send(1, Seq.fill(count)(Child(isLeaf = true, count, 3))) == 1 + (count - 2).max(0))
      dut.io.deepest.expect(6.U)
      dut.io.clear.poke(true.B)
      dut.clock.step()
      dut.io.clear.poke(false.B)
      dut.io.deepest.expect(0.U)
    }
  }
}

private sealed trait StackOperation { def context: Int }

private final case class Found(context: Int, children: Seq[Child]) extends StackOperation

private final case class Resumed(context: Int) extends StackOperation

/** Drives the stack like the traversal unit: each context has at most one operation in flight. */
private class StackDriver(dut: TraversalStack, config: ColonnadeConfig, seed: Int) {
  private val contexts  = config.array.contexts
  private val arity     = NodeRecord.most
  private val random    = new Random(seed)
  private val reference = new StackReference(contexts, config.columnBvhMemory.stackDepth)
  private val tMaxUnits = Array.fill(contexts)(BigInt(1000))
  private val expected  = Array.fill(contexts)(Option.empty[Option[Child]])

  private val foundQueue   = mutable.Queue.empty[Found]
  private val resumedQueue = mutable.Queue.empty[Resumed]
  private var overflows    = 0
  private var waited       = 0

  // Defined inputs from the first cycle; empty stacks
  dut.io.clear.poke(true.B)
  for (context <- 0 until contexts) {
    start(context)
    setLimit(context, 1000)
  }
  dut.io.clear.poke(false.B)

  def start(context: Int): Unit = {
    reference.start(context)
    dut.io.start.valid.poke(true.B)
    dut.io.start.bits.poke(context.U)
    step(accepted = 0.5)
    dut.io.start.valid.poke(false.B)
  }

  def setLimit(context: Int, tMax: BigInt): Unit = {
    tMaxUnits(context) = tMax
  }

  /** @return cycles until the step */
  def send(context: Int, children: Seq[Child]): Int = {
    offer(Found(context, children))
    await()
  }

  def resume(context: Int): Int = {
    offer(Resumed(context))
    await()
  }

  private def await(): Int = {
    var cycles = 0
    while (expected.exists(_.nonEmpty)) {
      assert(cycles < 100, "no step came")
      step(accepted = 1)
      cycles += 1
    }
    cycles - 1
  }

  /** Sends random operations on random contexts, then checks the statistics. */
  def run(operations: Int, accepted: Double): Unit = {
    var done = 0
    while (done < operations) {
      val context = random.nextInt(contexts)
      if (expected(context).isEmpty) {
        if (random.nextInt(25) == 0) start(context)
        setLimit(context, if (random.nextInt(4) == 0) BigInt(random.nextInt(12)) else 1000)
        val children = Seq.fill((random.nextInt(arity + 3) - 1).max(0).min(arity))(child())
        offer(if (random.nextInt(3) == 0) Resumed(context) else Found(context, children.sortBy(_.tNear)))
        done += 1
      }
      step(accepted)
    }
    while (expected.exists(_.nonEmpty)) step(accepted)
    for (_ <- 0 until 5) {
      dut.io.steps.valid.expect(false.B)
      dut.io.busy.expect(false.B)
      step(accepted = 1)
    }
    dut.io.deepest.expect(reference.deepest.U)
    assert(overflows == reference.overflows)
  }

  private def child(): Child =
    Child(random.nextBoolean(), random.nextInt(config.columnBvhMemory.depth), random.nextInt(12))

  private def offer(operation: StackOperation): Unit = operation match {
    case found: Found =>
      expected(found.context) = Some(reference.result(found.context, found.children, tMaxUnits(found.context)))
      foundQueue += found
    case resumed: Resumed =>
      expected(resumed.context) = Some(reference.resume(resumed.context, tMaxUnits(resumed.context)))
      resumedQueue += resumed
  }

  private def step(accepted: Double): Unit = {
    dut.io.results.valid.poke(foundQueue.nonEmpty.B)
    for (found <- foundQueue.headOption) {
      val bits = dut.io.results.bits
      bits.context.poke(found.context.U)
      bits.count.poke(found.children.size.U)
      for ((child, i) <- found.children.zipWithIndex) {
        bits.children(i).target.isLeaf.poke(child.isLeaf.B)
        bits.children(i).target.address.poke(child.address.U)
        bits.children(i).tNear.raw.asInstanceOf[SInt].poke(child.tNear.S)
      }
    }
    dut.io.resume.valid.poke(resumedQueue.nonEmpty.B)
    for (resumed <- resumedQueue.headOption) dut.io.resume.bits.poke(resumed.context.U)
    val accepts = random.nextDouble() < accepted
    dut.io.steps.ready.poke(accepts.B)
    dut.io.tMax.units.raw.asInstanceOf[SInt].poke(tMaxUnits(dut.io.tMax.context.peekInt().toInt).S)

    waited += 1
    assert(waited < 100, "nothing happens")
    if (accepts && dut.io.steps.valid.peekBoolean()) check()
    if (dut.io.overflow.peekBoolean()) overflows += 1
    if (foundQueue.nonEmpty && dut.io.results.ready.peekBoolean()) foundQueue.dequeue()
    if (resumedQueue.nonEmpty && dut.io.resume.ready.peekBoolean()) resumedQueue.dequeue()
    dut.clock.step()
  }

  private def check(): Unit = {
    val step    = dut.io.steps.bits
    val context = step.context.peekInt().toInt
    val answer  = expected(context).getOrElse(fail(s"context $context has no operation in flight"))
    step.isDone.expect(answer.isEmpty.B)
    for (child <- answer) {
      step.target.isLeaf.expect(child.isLeaf.B)
      step.target.address.expect(child.address.U)
    }
    expected(context) = None
    waited = 0
  }

  private def fail(message: String): Nothing = throw new AssertionError(message)
}
