package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{NodeRecord, RecordFormats}
import colonnade.numbers.Fixed
import colonnade.numbers.FixedPorts._
import colonnade.ray.{BoxRay, RayFormats}
import colonnade.traversal.{SmallTree, StackReference}
import colonnade.{Always, Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** Traverses whole trees like the traversal unit: records come after a random latency, leaves may reduce tMax. */
class TraversalSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "Traversal"

  private def config(contexts: Int, bvh: Boolean = true): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    geometry = TestConfigs.tiny.geometry.copy(bvh = bvh)
  )

  for (contexts <- Seq(5, 2))
    it should s"walk trees with $contexts contexts like the reference" taggedAs Always.unless(contexts == 2) in {
      val shape = config(contexts)
      test(new TraversalHarness(shape)).withAnnotations(Simulation.verilator) { dut =>
        for ((accepted, shrinks, seed) <- Seq((1.0, false, 1), (0.4, true, 2)))
          new TreeWalkers(dut, shape, seed).run(rays = 40, accepted, shrinks)
      }
    }

  it should "treat an illegal node as empty and report it" in {
    val shape = config(contexts = 1)
    val most  = (BigInt(1) << RecordFormats.addressBits(shape)) - 1
    val tree  = new SmallTree(shape, rayCount = 1, seed = 4)
    val root  = tree.fields(tree.nodes(0), "node.")
    val ray   = new Packed(new BoxRay(shape.numbers)).pack(tree.fields(tree.rays.head, "ray."))

    def changed(fields: (String, Int)*): Map[String, BigInt] =
      root ++ fields.map { case (name, value) => name -> BigInt(value) }
    val last  = most.toInt + 1 - (root("nodes") + root("leaves")).toInt
    val cases = Seq(
      (changed(), 0, true),
      (changed("first" -> 6), 5, true),
      (changed("first" -> 5), 5, false),
      (changed("first" -> 4), 5, false),
      (changed("first" -> last), 5, true),
      (changed("first" -> (last + 1)), 5, false),
      (changed("first" -> most.toInt), 5, false),
      (changed("first" -> 0, "nodes" -> 0, "leaves" -> 0), 5, true),
      (changed("first" -> 0, "nodes" -> 0, "leaves" -> 1), 5, false),
      (changed("nodes" -> 3, "leaves" -> 2), 0, false),
      (changed("corner.x" -> 0), 0, false),
      (changed("corner.y" -> (2 << shape.numbers.maxExponent)), 0, false)
    )
    test(new TraversalHarness(shape)).withAnnotations(Simulation.verilator) { dut =>
      dut.io.steps.ready.poke(true)
      dut.tMaxUnits(0).pokeRaw((BigInt(1) << (shape.numbers.boxDistanceBits - 1)) - 1)
      for (((fields, address, isLegal), index) <- cases.zipWithIndex) withClue(s"case $index: ") {
        dut.io.start.valid.poke(true)
        dut.io.start.bits.poke(0)
        dut.clock.step()
        dut.io.start.valid.poke(false)
        dut.io.nodes.valid.poke(true)
        dut.io.nodes.bits.context.poke(0)
        dut.io.nodes.bits.address.poke(address)
        dut.node.poke(new Packed(new NodeRecord(shape)).pack(fields))
        dut.ray.poke(ray)
        dut.io.nodes.ready.expect(true)
        dut.io.illegal.expect(!isLegal)
        dut.clock.step()
        dut.io.nodes.valid.poke(false)
        dut.io.illegal.expect(false)
        for (_ <- 0 until 20 if !dut.io.steps.valid.peekBoolean()) dut.clock.step()
        dut.io.steps.valid.expect(true)
        dut.io.steps.bits.isDone.expect(!isLegal || fields("nodes") + fields("leaves") == 0)
        dut.clock.step()
      }
    }
  }

  it should "visit every leaf without a tree" in
    test(new TraversalHarness(config(contexts = 2, bvh = false))) { dut =>
      dut.io.scene.recordCount.poke(4)
      dut.io.steps.ready.poke(true)
      for (context <- 0 until 2) {
        dut.io.start.valid.poke(true)
        dut.io.start.bits.poke(context)
        dut.clock.step()
      }
      dut.io.start.valid.poke(false)
      for (count <- 1 to 4; context <- 0 until 2) {
        dut.io.resume.valid.poke(true)
        dut.io.resume.bits.poke(context)
        dut.clock.step()
        dut.io.resume.valid.poke(false)
        for (_ <- 0 until 10 if !dut.io.steps.valid.peekBoolean()) dut.clock.step()
        dut.io.steps.valid.expect(true)
        dut.io.steps.bits.context.expect(context)
        dut.io.steps.bits.isDone.expect(count == 4)
        if (count < 4) dut.io.steps.bits.target.address.expect(count)
        dut.clock.step()
      }
    }
}

/** Packs node and ray into one port each, and has a limit for each context. */
private class TraversalHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new Traversal(config))

  val node = IO(Input(UInt(new NodeRecord(config).getWidth.W)))
  val ray  = IO(Input(UInt(new BoxRay(config.numbers).getWidth.W)))
  val io   = IO(chiselTypeOf(unit.io))

  private val units = new Fixed(new RayFormats(config.numbers).units)
  val tMaxUnits     = IO(Input(Vec(config.array.contexts, units)))
  io :<>= unit.io
  unit.io.tMax.foreach(reader => reader.units := tMaxUnits(reader.context))
  unit.io.nodes.bits.node := node.asTypeOf(new NodeRecord(config))
  unit.io.nodes.bits.ray  := ray.asTypeOf(new BoxRay(config.numbers))
}

/** Rays in a random tree; each context has at most one. */
private class TreeWalkers(dut: TraversalHarness, config: ColonnadeConfig, seed: Int) {
  private final class Walk(val ray: Int) {
    var tMax   = farthest
    var leaves = Vector.empty[Int]
  }

  private val contexts  = config.array.contexts
  private val farthest  = (BigInt(1) << (config.numbers.boxDistanceBits - 1)) - 1
  private val random    = new Random(seed)
  private val tree      = new SmallTree(config, rayCount = 40, seed)
  private val reference = new StackReference(contexts, config.columnBvhMemory.stackDepth)
  private val walks     = mutable.Map.empty[Int, Walk]

  private val rayBits  = tree.rays.map(ray => new Packed(new BoxRay(config.numbers)).pack(tree.fields(ray, "ray.")))
  private val nodeBits =
    tree.nodes.view.mapValues(node => new Packed(new NodeRecord(config)).pack(tree.fields(node, "node."))).toMap

  /** The state of contexts: a record is read, then offered; or the next step is expected. */
  private val reading  = mutable.Map.empty[Int, StackReference.Child]
  private val nodes    = mutable.Queue.empty[(Int, Int)]
  private val resuming = mutable.Queue.empty[Int]
  private val expected = mutable.Map.empty[Int, Option[StackReference.Child]]
  private var begun    = 0
  private var ended    = 0
  private var steps    = 0

  dut.io.clear.poke(true)
  dut.clock.step()
  dut.io.clear.poke(false)

  def run(rays: Int, accepted: Double, shrinks: Boolean): Unit = {
    var idle = 0
    while (ended < rays) {
      val starts =
        (0 until contexts).find(!walks.contains(_)).filter(_ => begun < rays && random.nextBoolean())
      dut.io.start.valid.poke(starts.nonEmpty)
      starts.foreach(begin)
      offer()
      dut.io.illegal.expect(false)
      val accepts = random.nextDouble() < accepted
      dut.io.steps.ready.poke(accepts)

      idle += 1
      assert(idle < 100, "nothing happens")
      if (accepts && dut.io.steps.valid.peekBoolean()) {
        take()
        idle = 0
      }
      if (nodes.nonEmpty && dut.io.nodes.ready.peekBoolean()) nodes.dequeue()
      if (resuming.nonEmpty && dut.io.resume.ready.peekBoolean()) resuming.dequeue()
      dut.clock.step()
      for (context <- reading.keys.toSeq.sorted if random.nextInt(3) == 0) finish(context, shrinks)
    }
    dut.io.deepest.expect(reference.deepest)
    assert(reference.overflows == 0 && steps > 2 * rays, s"only $steps steps of $rays rays")
  }

  private def begin(context: Int): Unit = {
    dut.io.start.bits.poke(context)
    reference.start(context)
    walks(context) = new Walk(begun)
    dut.tMaxUnits(context).pokeRaw(farthest)
    reading(context) = StackReference.Child(isLeaf = false, address = 0, tNear = 0)
    begun += 1
  }

  private def offer(): Unit = {
    dut.io.nodes.valid.poke(nodes.nonEmpty)
    for ((context, address) <- nodes.headOption) {
      dut.io.nodes.bits.context.poke(context)
      dut.io.nodes.bits.address.poke(address)
      dut.node.poke(nodeBits(address))
      dut.ray.poke(rayBits(walks(context).ray))
    }
    dut.io.resume.valid.poke(resuming.nonEmpty)
    resuming.headOption.foreach(dut.io.resume.bits.poke(_))
  }

  /** The record of a context has arrived: a node goes to the box unit, a leaf is tested and the ray resumes. */
  private def finish(context: Int, shrinks: Boolean): Unit = {
    val walk   = walks(context)
    val target = reading.remove(context).get
    if (target.isLeaf) {
      walk.leaves :+= target.address.toInt
      if (shrinks && random.nextBoolean()) {
        walk.tMax = walk.tMax.min(target.tNear + random.nextInt(1 << (config.numbers.vertexBits - 3)))
        dut.tMaxUnits(context).pokeRaw(walk.tMax)
      }
      expected(context) = reference.resume(context, walk.tMax)
      resuming += context
    } else {
      val address = target.address.toInt
      expected(context) = reference.result(context, tree.children(walk.ray, address, walk.tMax), walk.tMax)
      nodes += ((context, address))
    }
  }

  private def take(): Unit = {
    val next    = dut.io.steps.bits
    val context = next.context.peekInt().toInt
    assert(expected.contains(context), s"context $context has no operation in flight")
    val answer = expected.remove(context).get
    next.isDone.expect(answer.isEmpty)
    for (child <- answer) {
      next.target.isLeaf.expect(child.isLeaf)
      next.target.address.expect(child.address)
      reading(context) = child
      steps += 1
    }
    if (answer.isEmpty) {
      end(walks.remove(context).get)
      ended += 1
    }
  }

  /** Each leaf was visited at most once, and all leaves within the final tMax were visited. */
  private def end(walk: Walk): Unit = {
    val visited = walk.leaves.toSet
    assert(visited.size == walk.leaves.size, walk.leaves.toString)
    assert(tree.leaves(walk.ray, walk.tMax).subsetOf(visited))
    assert(visited.subsetOf(tree.leaves(walk.ray, farthest)))
  }
}
