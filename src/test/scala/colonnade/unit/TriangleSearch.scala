package colonnade.unit

import colonnade.Model
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Leaf, LeafRecord}
import colonnade.shading.Occlusion

/** Finds what rays meet in a small scene by the model's test of each triangle, without a tree. */
final class TriangleSearch(config: ColonnadeConfig, scene: SmallScene) {
  import TriangleSearch._

  /** With the address of its record. */
  val triangles: Vector[(Int, Triangle)] = {
    val words = scene.leafAddresses.map(at =>
      Seq.tabulate(LeafRecord.recordBits(config.geometry) / 32)(i => (scene.records(at) >> (32 * i)) & 0xffffffffL)
    )
    val leaves = Model.leaves(config, words, "leaf")
    for {
      (leaf, address) <- leaves.toVector.zip(scene.leafAddresses)
      vertices = leaf.slice(3, 15).grouped(3).toSeq
      k <- 0 until (if (leaf.head == 1) 1 else Leaf.maxTriangles)
      corners = Leaf.corners.map { case (second, first) => vertices(if (k == 1) second else first) }
    } yield address -> Triangle(Leaf.maxTriangles * address + k, leaf(1) == 1, corners)
  }

  /** By ray, given by the fields of a [[colonnade.ray.PreparedRay]]: occlusion of a shadow ray, or the fields of its
    * closest hit.
    */
  def hits(rays: Seq[Fields], among: Seq[Triangle]): Vector[(Occlusion.Type, Option[Fields])] = {
    val pairs   = for (ray <- rays; triangle <- among) yield forTriangles(ray) ++ triangle.vertices.flatten
    val answers = Model.answers(config, pairs, "triangle").grouped(among.size).toVector
    rays.toVector.zip(answers).map { case (ray, answers) =>
      val hits = among.zip(answers).filter { case (_, hit) => hit.head == 1 && hit(1) < ray("tMax") }
      if (ray("isShadow") == 1) {
        val isOpaque = hits.exists { case (triangle, _) => !triangle.isTransmissive || !config.frame.hasBounces }
        val met      = if (isOpaque) Occlusion.opaque else if (hits.nonEmpty) Occlusion.transmissive else Occlusion.none
        (met, None)
      } else
        (
          Occlusion.none,
          hits.minByOption { case (triangle, hit) => (hit(1), triangle.id) }.map { case (triangle, hit) =>
            Map("t" -> hit(1), "id" -> triangle.id, "backSide" -> hit(5)) ++
              (0 until 3).map(i => s"weights[$i]" -> hit(2 + i))
          }
        )
    }
  }
}

object TriangleSearch {
  type Fields = Map[String, BigInt]

  final case class Triangle(id: BigInt, isTransmissive: Boolean, vertices: Seq[Seq[BigInt]])

  /** The ray's numbers in the order of the model's question `triangle`. */
  private def forTriangles(ray: Fields): Seq[BigInt] = {
    val numbers = Seq("orientation.axis") ++ (0 until 3).map(i => s"orientation.negative[$i]") ++
      (0 until 3).map(i => s"origin[$i]") ++ (0 until 2).map(i => s"shear[$i]")
    numbers.map(name => ray(s"ray.$name"))
  }
}
